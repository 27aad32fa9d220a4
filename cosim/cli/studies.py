"""The commands that run studies."""

import sys
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from cosim.cli.command import Command, print_page, progress_bar, writable
from cosim.studies.study import Study, Told, loaded, studies


def commands() -> list[Command]:
    """A command for each study that declares one."""
    alone: list[Command] = []
    charts: list[Command] = []
    for study in studies():
        if study.command:
            *group, name = study.command.split()
            made = Command(name, study.help, partial(_run, study), study.options, study.out)
            (charts if group else alone).append(made)
    return [*alone, Command("chart", "the studies, as tables and a figure", commands=charts)]


def _run(study: Study, out: Path | None = None, **asked: Any) -> None:
    """Run a study with the options given, save and print its results."""
    shown = asked.pop("show", False)
    title = study.name
    if "<scene>" in study.out:
        from cosim.scene import load

        scene = asked["scene"] = load(asked["scene"], asked.pop("overrides", ()))
        title = scene.name
    out = out or Path(study.out.replace("<scene>", title))
    for option in study.options:
        if option.read:
            asked[option.argument] = loaded(option.read)(asked.get(option.argument, []))
    known = {option.argument: option.default for option in study.options} | asked
    bar = progress_bar(title, known.get(study.total), study.unit) if study.tells else nullcontext()
    steps = _Steps(study.unit)
    with writable(out, shared=not study.writes), bar as seen:
        shows = {name: partial(_show, seen, steps, means) for name, means in study.tells.items()}
        try:
            found = study.function(**asked, **shows, **({"out": out} if study.saves else {}))
        except KeyboardInterrupt:
            if study.saves and steps.done:
                print(f"cosim: {steps} kept in {out}; the same command goes on.", file=sys.stderr)
            raise
        results = found if isinstance(found, tuple) else (found,)
        for result in () if study.saves else results:
            result.save(out)
    if not study.writes:
        for report in results:
            print(f"{report}\n\n{report.written(out)}")
        return
    print(loaded(study.told)(found) if study.told else found)
    print(f"Written to {out}: {study.writes}")
    if study.figures:
        paths = ", ".join(str(out / name) for name in study.figures)
        print(f"Figure{'s' * (len(study.figures) > 1)}: {paths}")
    if shown:
        print_page(out)
    if study.check:
        loaded(study.check)(found)


@dataclass
class _Steps:
    """A study's progress, counted here since a hidden progress bar does not count."""

    unit: str
    done: int = 0
    total: int | None = None

    def __str__(self) -> str:
        of = f" of {self.total}" if self.total else ""
        return f"{self.done}{of} {self.unit}{'s' * (self.done > 1 or bool(self.total))} are"


def _show(bar: Any, steps: _Steps, means: Told, *told: Any) -> None:
    """Move the bar; ``means`` turns the study's message into steps done, total and words."""
    done, total, words = means(*told)
    steps.done = steps.done + 1 if done is None else done
    steps.total = total or steps.total
    if total is not None and bar.total is None:
        bar.reset(total)
        bar.initial = done or 0  # steps of an earlier study tell nothing of the rate
    bar.set_postfix_str(words, refresh=False)
    bar.update(1 if done is None else done - bar.n)
