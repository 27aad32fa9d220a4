"""``cosim export``."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from cosim.cli.command import Command
from cosim.cli.options import add_out, writable


def _options(parser: ArgumentParser) -> None:
    from cosim.waveforms.formats import formats

    parser.add_argument("run", type=Path, metavar="DIR", help="a folder that cosim run wrote")
    known = ", ".join(f"{one.name} ({one.help})" for one in formats().values())
    parser.add_argument(
        "--as",
        dest="forms",
        metavar="FORM,...",
        action="append",
        required=True,
        help=f"{known}; repeatable",
    )
    add_out(parser, "the run", known=False)


def _run(arguments: Namespace) -> None:
    from cosim.waveforms import formats

    chosen = formats.parse(arguments.forms)
    run = formats.read(arguments.run)
    folder = arguments.out or arguments.run
    with writable(folder):
        files = formats.export(run, chosen, folder)
    width = max(map(len, files))
    print(f"Written to {folder}:")
    for name, note in files.items():
        print(f"  {name:<{width}}  {note}")


COMMAND = Command("export", "write a finished run in other programs' formats", _run, _options)
