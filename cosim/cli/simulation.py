"""The commands that simulate, make, list, show and export scenes and runs, and write FMUs."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cosim.cli.command import Command, print_page, progress_bar, writable
from cosim.studies.study import COLUMNS, OVERRIDES, SCENE, SHOW, Option

_BAR = "{desc} {percentage:3.0f}% |{bar}| {n:.2f} of {total:g} s, {remaining} left"


def _run(
    scene: str,
    overrides: Sequence[str] = (),
    spread: bool = False,
    strict: bool = False,
    link: bool = False,
    show: bool = False,
    out: Path | None = None,
) -> None:
    from cosim.scene import load, to_link

    base = load(scene, overrides)
    if link:
        print(to_link(base))
        return
    folder = out or Path("results") / base.name
    if spread:
        from cosim.studies.tune.spread import turns

        turns(base)  # refuses a scene without knobs before it is run
    with writable(folder):
        import cosim
        from cosim.files.atomic import write_json
        from cosim.simulation.elsewhere import on_disk_in
        from cosim.waveforms.report import table

        def progress(reached: float) -> None:
            bar.update(reached - bar.n)
            if strict and reached >= base.run.duration:
                bar.set_description(f"{base.name}: done; finer runs go on")

        with (
            progress_bar(base.name, base.run.duration, "s", delay=1.0, bar_format=_BAR) as bar,
            on_disk_in(folder),
        ):
            result = cosim.run(base, progress=progress, strict=strict)
        result.save(folder)
        found = None
        if spread:
            with progress_bar("spread", None, "run") as bar:
                found = cosim.spread(result.scene, progress=progress)
            path = folder / "summary.json"
            saved = json.loads(path.read_text(encoding="utf-8"))
            write_json(path, saved | {"spread": found.summary()})
    print(f"{base.name}: {base.description}" if base.description else base.name)
    print(table(result.scene, result.summary, result.units))
    if found is not None:
        print(found)
    print(f"Written to {folder}: waveforms.csv, waveforms.nc, summary.json, scene.toml")
    print(f"Figure: {folder / 'figure.png'}")
    if show:
        print_page(folder)


def _scenes(scene: str | None = None) -> None:
    from cosim.scene.loading import groups, list_scenes, load

    if scene is not None:
        from cosim.scene.model import differing

        found = load(scene)
        print(f"{found.name}: {found.description}")
        print("\n".join(differing(found)))
        return
    told = dict(list_scenes())
    width = max(map(len, told))
    for title, names in groups().items():
        print(f"{title}:")
        for name in names:
            print(f"  {name:<{width}}  {told[name]}")
    print("\nWhat is in one: cosim scenes NAME; one of your own: cosim new FILE.toml")


def _export_options() -> list[Option]:
    from cosim.waveforms.formats import formats

    known = ", ".join(f"{one.name} ({one.help})" for one in formats().values())
    return [
        Option("run", "a folder that cosim run or sweep wrote, the last of them", "DIR", Path),
        Option(
            *("--as", f"{known}; of a sweep csv, parquet, mat; repeatable", "FORM,..."),
            parameter="forms",
            many="repeat",
            needed=True,
        ),
    ]


def _export(run: Path, forms: list[str], out: Path | None = None) -> None:
    from cosim.waveforms import formats
    from cosim.waveforms.storage import last_written

    folder = out or run
    if last_written(run, "waveforms.nc", "sweep.nc") == "sweep.nc":
        from cosim.studies.sweep import export

        with writable(folder):
            files = export.export(run, forms, folder)
    else:
        chosen = formats.parse(forms, formats.formats(), "run")
        result = formats.read(run)
        with writable(folder):
            files = formats.export(result, chosen, folder)
    width = max(map(len, files))
    print(f"Written to {folder}:")
    for name, note in files.items():
        print(f"  {name:<{width}}  {note}")


_FMU = "results/fmu"


def _build(out: Path = Path(_FMU)) -> None:
    from cosim.mechanics import package

    with writable(out):
        paths = package.pack(out)
    for path in paths.values():
        print(path)


def _check() -> bool:
    from cosim.mechanics import package

    return bool(package.check())


def _netlist(
    netlist: Path, outputs: list[str], out: Path = Path(_FMU), fmi: str = "2", **asked: Any
) -> None:
    from cosim.fmus import netlist as fmus

    target = out / f"{netlist.stem}.fmu"
    with writable(out):
        fmus.netlist(netlist, outputs, target, version=int(fmi), **asked)
    print(target)


_READ = 'what the importer reads, as "v(out)" or "i(V1)*v(out)"; repeatable'
_FMI = Option("--fmi", "version of FMI", choices=("2", "3"), default="2")
_NETLIST = (
    Option("netlist", "a netlist of one's own", "NETLIST", Path),
    Option(
        *("--input", "a V or I source that the importer sets; repeatable", "SOURCE"),
        parameter="inputs",
        many="repeat",
    ),
    Option(*("--output", _READ, "WORDS"), parameter="outputs", many="repeat", needed=True),
    Option("--max-step", "longest step of ngspice", "s", float, 2e-5),
    Option("--reltol", "ngspice's relative tolerance", kind=float, default=1e-5),
    _FMI,
)


def _ssp(
    scene: str, overrides: Sequence[str] = (), fmi: str = "2", out: Path | None = None
) -> None:
    from cosim.fmus.ssp import ssp
    from cosim.scene import load

    base = load(scene, overrides)
    target = out or Path(_FMU) / f"{base.name}.ssp"
    with writable(target.parent):
        ssp(base, target, int(fmi))
    print(target)


def _pack(library: Path, fmi: str = "2", out: Path = Path(_FMU)) -> None:
    from cosim.fmus.pack import pack

    target = out / f"{library.stem}.fmu"
    with writable(out):
        pack(library, target, int(fmi))
    print(target)


_LIBRARY = Option("library", "a library of a model in C and of fmu/thin", "LIBRARY", Path)
_FILE = Option("--out", f"the file (default: {_FMU}/<scene>.ssp)", "FILE.ssp", Path)


def _live(
    scene: str = "paper-limited",
    overrides: Sequence[str] = (),
    trial: Path | None = None,
    columns: str = "",
    out: Path | None = None,
) -> None:
    from cosim.live.page import html, opened
    from cosim.trials.recording import read_recording

    link, circuits = opened(scene, overrides)
    record = None if trial is None else read_recording(trial, columns)
    if out is not None:
        from cosim.files.atomic import tidy, write_text

        tidy(out.parent)
        write_text(out, html(link, record=record))
        print(f"Written to {out}; with another setting: {out}#scene=…")
        return
    import webbrowser

    from cosim.live.server import Server

    with Server(link, circuits, record) as server:
        print(f"{server.address}/{link}\nFor this machine alone; Ctrl-C ends it.", flush=True)
        webbrowser.open(f"{server.address}/{link}")
        server.serve_forever(poll_interval=0.2)


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
        "export",
        "write a finished run in other programs' formats",
        _export,
        _export_options,
        "the run",
    ),
    Command(
        "fmu",
        "write or check FMU files: of the mechanics, a netlist, the whole machine",
        commands=(
            Command("build", "write stickslip-fmi2.fmu and stickslip-fmi3.fmu", _build, out=_FMU),
            Command("check", "validate the FMU files and run them", _check),
            Command("netlist", "write a netlist as an FMU", _netlist, _NETLIST, _FMU),
            Command(
                "pack", "write a model of one's own in C as an FMU", _pack, (_LIBRARY, _FMI), _FMU
            ),
            Command(
                "ssp",
                "write a scene's machine as an .ssp: its FMUs, and how they are joined",
                _ssp,
                (SCENE, OVERRIDES, _FMI, _FILE),
            ),
        ),
    ),
    Command(
        "live",
        "open the machine in the browser, moving, with knobs to turn",
        _live,
        (
            Option("scene", "scene or link (default: paper-limited)", "SCENE", many="optional"),
            OVERRIDES,
            Option("--trial", "measurements to lay over the curves", "TRIAL.csv", Path),
            COLUMNS,
            Option("--out", "write the page as one HTML file instead", "FILE.html", Path),
        ),
    ),
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
                choices=("machine", "circuit", "fmu"),
            ),
            Option(
                "--base",
                "the built-in scene that a machine or circuit starts from (default: paper-limited)",
                "SCENE",
            ),
        ),
    ),
    Command(
        "run",
        "run a scene; write waveforms, summary and figure",
        _run,
        (
            SCENE,
            OVERRIDES,
            Option(
                "--spread",
                "also tell the spread of the answer: v_average with each of the three knobs turned "
                "by 2 % either way",
                kind=bool,
            ),
            Option(
                "--error",
                "estimate the error of v_average from two finer runs, and tell v_average of three "
                "more starts; takes about ten times as long",
                kind=bool,
                parameter="strict",
            ),
            Option(
                "--link",
                "run nothing: print SCENE with its changes as a link, which every command takes as "
                "SCENE",
                kind=bool,
            ),
            SHOW,
        ),
        "results/<scene>",
    ),
    Command(
        "scenes",
        "list the built-in scenes, or what is in one",
        _scenes,
        [Option("scene", "show its keys that differ from the defaults", "SCENE", many="optional")],
    ),
    Command(
        "show",
        "write a page to look into results: curves, maps, cursors; one file, to be mailed",
        print_page,
        (
            Option("results", "what run, sweep, compare, chart wrote last", "DIR|TABLE.csv", Path),
            Option("--out", "where to write (default: show.html beside it)", "FILE.html", Path),
        ),
    ),
)
