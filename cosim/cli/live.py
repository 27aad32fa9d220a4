"""The command that opens the live bench."""

from collections.abc import Sequence
from pathlib import Path

from cosim.cli.command import Command
from cosim.cli.work import print_page
from cosim.studies.study import OVERRIDES, Option


def _live(
    scene: str = "paper-limited",
    overrides: Sequence[str] = (),
    trial: Path | None = None,
    out: Path | None = None,
) -> None:
    from cosim.live.page import html, opened

    link, circuits = opened(scene, overrides)
    if out is not None:
        from cosim.files.atomic import tidy, write_text

        tidy(out.parent)
        write_text(out, html(link, record=trial))
        print(f"Written to {out}; with another setting: {out}#scene=…")
        return
    import webbrowser

    from cosim.live.server import Server

    with Server(link, circuits, trial) as server:
        print(f"{server.address}/{link}\nFor this machine alone; Ctrl-C ends it.", flush=True)
        webbrowser.open(f"{server.address}/{link}")
        server.serve_forever(poll_interval=0.2)


COMMANDS = (
    Command(
        "live",
        "open the machine in the browser, moving, with knobs to turn",
        _live,
        (
            Option("scene", "scene or link (default: paper-limited)", "SCENE", many="optional"),
            OVERRIDES,
            Option("--trial", "measurements to lay over the curves", "TRIAL.csv", Path),
            Option("--out", "write the page as one HTML file instead", "FILE.html", Path),
        ),
    ),
    Command(
        "show",
        "write a page to look into results: curves, maps, cursors; one file, to be mailed",
        print_page,
        (
            Option("results", "what run, sweep, compare or a chart wrote", "DIR|TABLE.csv", Path),
            Option("--out", "where to write (default: show.html beside it)", "FILE.html", Path),
        ),
    ),
)
