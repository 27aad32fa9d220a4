"""The page's own scripts, run by node."""

import json
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import cosim.live.page
from cosim.live import rigs

NODE = shutil.which("node")
needs_node = pytest.mark.skipif(NODE is None, reason="node is not installed")
WEB = Path(cosim.live.page.__file__).with_name("web")


@cache
def known() -> str:
    return json.dumps(rigs.data())


def run(code: str, given: Any) -> Any:
    """What ``code``, the body of a function of ``given`` and the WebAssembly's bytes, returns."""
    assert NODE is not None
    script = "\n".join(
        [
            f"const DATA = {known()};",
            cosim.live.page.script(("machine.js", "settings.js")),
            f'const bytes = require("fs").readFileSync({json.dumps(str(WEB / "machine.wasm"))});',
            f"const answer = ((given) => {{ {code} }})({json.dumps(given)});",
            "process.stdout.write(JSON.stringify(answer));",
        ]
    )
    done = subprocess.run([NODE, "-"], input=script, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)
