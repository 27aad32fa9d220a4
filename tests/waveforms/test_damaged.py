"""A damaged waveforms.nc is exported as far as it is whole, or told in one sentence."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.cli.main import main
from cosim.errors import BadInput
from cosim.waveforms import formats

pytestmark = [pytest.mark.reliability, pytest.mark.usefixtures("undrawn")]

SHORT = ["--set", "run.duration=0.03", "--set", "run.settle=0", "--set", "run.output_step=2e-3"]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    assert main(["run", "held", *SHORT, "--out", str(folder)]) == 0
    return folder


PYTHONS = ("index", "buffer", "attribute", "NoneType", "unpack", "codec", "object", "dtype")
"""Words of its own errors, which tell a user nothing."""

PLACES = st.one_of(st.integers(0, 300), st.integers(0, 10_000))
FLAW = st.tuples(PLACES, st.one_of(st.sampled_from([0, 1, 255]), st.integers(0, 255), st.none()))


@given(flaws=st.lists(FLAW, min_size=1, max_size=6), form=st.sampled_from([*formats.formats()]))
def test_exported_or_told(
    flaws: list[tuple[int, int | None]], form: str, run: Path, tmp_path_factory
) -> None:
    content = bytearray((run / "waveforms.nc").read_bytes())
    for place, byte in flaws:
        if byte is None:
            del content[place : place + 4]
        elif place < len(content):
            content[place] = byte
    folder = tmp_path_factory.mktemp("damaged")
    (folder / "waveforms.nc").write_bytes(content)
    try:
        formats.export(formats.read(folder), [form], folder / "out")
    except BadInput as error:
        assert str(error).isprintable() and len(str(error)) < 1000
        assert not any(word in str(error) for word in PYTHONS)
        assert not (folder / "out").exists()
