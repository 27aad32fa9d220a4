"""The command that makes a scene to begin with."""

from pathlib import Path

from cosim.cli.command import Command, writable
from cosim.studies.study import Option

_KINDS = ("machine", "circuit", "fmu")
_SCHEMA = "scene.schema.json"
_TITLE = b'"Scene of cosim"'
"""Text by which a schema written here is told from another file of that name."""


def _new(file: Path, kind: str = "machine", base: str | None = None) -> None:
    import os
    import re

    from cosim.errors import BadInput, plain
    from cosim.files.atomic import as_json, together
    from cosim.files.reader import read
    from cosim.files.resources import circuits
    from cosim.scene.loading import list_scenes, load
    from cosim.scene.messages import suggestion
    from cosim.scene.model import CAREFUL, schema, to_toml
    from cosim.scene.toml import LARGEST

    name = plain(file)
    if file.suffix != ".toml" or not file.stem.replace("-", "").replace("_", "").isalnum():
        raise BadInput(f"{name}: must end in .toml, its name have letters, digits, - and _ alone.")
    if kind == "fmu" and base is not None:
        raise BadInput(f"--base {plain(base)}: a scene of kind fmu starts from none.")
    base = "paper-limited" if base is None else base
    if base not in (known := [scene for scene, *_ in list_scenes()]):
        raise BadInput(f"--base {plain(base)}: must be a built-in scene{suggestion(base, known)}.")
    texts: dict[Path, str] = {}
    if kind == "fmu":
        texts[file] = (circuits() / "new" / "fmu.toml").read_text(encoding="utf-8")
    elif kind == "circuit":
        if (scene := load(base)).has_ports:
            raise BadInput(f"--base {base}: has FMUs of its own; take a scene without.")
        told = {"description": "The machine on a circuit of my own"}
        text = to_toml(scene.having(circuit=CAREFUL).model_copy(update=told), base)
        own = f'[circuit]\nmodel = "file"\nnetlist = "{file.stem}.cir"  # beside this file\n'
        text = text.replace("[circuit]\n", own)
        texts[file] = re.sub("(?m)^# (model|netlist) = .*\\n", "", text)
    else:
        texts[file] = to_toml(load(base), base)
    if kind != "machine":
        text = (circuits() / "new" / f"{kind}.cir").read_text(encoding="utf-8")
        texts[file.with_suffix(".cir")] = text
    fmus = [file.with_suffix(".fmu")] if kind == "fmu" else []
    schema_there = file.with_name(_SCHEMA)
    theirs = schema_there.is_file() and _TITLE not in read(schema_there, LARGEST)
    for path in (*texts, *fmus, *[schema_there] * theirs):
        if os.path.lexists(path):  # a link that leads nowhere, too
            raise BadInput(f"{plain(path)}: is there already; choose another name.")
    texts = {path: text.replace("NAME.", f"{file.stem}.") for path, text in texts.items()}
    texts[file] = f"#:schema ./{_SCHEMA}\n{texts[file]}"  # by which editors find it
    texts[schema_there] = as_json(schema())
    paths = [*texts, *fmus]
    with writable(file.parent, shared=True), together(paths) as temporary:
        for target, text in zip(temporary, texts.values(), strict=False):
            target.write_text(text, encoding="utf-8")
        for target in temporary[len(texts) :]:
            from cosim.mechanics import package

            package.write(target, 3)
    beside = ", ".join(path.name for path in paths[1:])
    print(f"Written: {file}, beside it {beside}. Now: cosim run {file}")


COMMANDS = (
    Command(
        "new",
        "make a commented scene to begin with: a machine, a circuit or an FMU of one's own",
        _new,
        (
            Option("file", "the scene, which must not be there yet", "FILE.toml", Path),
            Option(
                "--kind",
                "machine: every key with its unit and meaning; circuit: also a netlist; fmu: a "
                "netlist, an FMU, and the ports that join them (default: machine)",
                choices=_KINDS,
            ),
            Option(
                "--base",
                "the built-in scene that a machine or circuit starts from (default: paper-limited)",
                "SCENE",
            ),
        ),
    ),
)
