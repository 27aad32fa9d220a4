"""A study's declaration, against its function, the command line and the library."""

import inspect
from pathlib import Path

import pytest

import cosim
from cosim.cli.main import main
from cosim.studies.study import SHOW, Option, Study, studies

FOLDER = Path(cosim.__file__).parent / "studies"
EVERY = pytest.mark.parametrize("study", studies(), ids=lambda study: study.name)


def test_each_folder_declares_a_study() -> None:
    folders = {path.parent.name for path in FOLDER.glob("*/__init__.py")}
    assert folders == {study.module.split(".")[2] for study in studies()}
    assert len({study.name for study in studies()}) == len(studies())


@EVERY
def test_what_is_declared_is_what_the_function_takes(study: Study) -> None:
    """Its parameters, and the defaults that the help names."""
    parameters = inspect.signature(study.function).parameters
    assert study.function.__doc__
    given = {option.argument for option in study.options if option is not SHOW}
    given |= {"out"} if study.command and study.saves else set()
    given |= set(study.tells)
    assert given <= set(parameters)
    needed = {name for name, one in parameters.items() if one.default is one.empty}
    assert needed <= given or not study.command
    for option in study.options:
        if option.default is not None:
            default = parameters[option.argument].default
            assert option.default == (default[0] if option.many == "any" else default)


@EVERY
def test_the_library_has_it(study: Study) -> None:
    if study.library:
        assert getattr(cosim, study.name) is study.function
    assert (study.name in dir(cosim)) == (study.library or hasattr(cosim, study.name))


@EVERY
def test_its_help(study: Study, capsys: pytest.CaptureFixture[str]) -> None:
    if study.command:
        with pytest.raises(SystemExit):
            main([*study.command.split(), "--help"])
        told = " ".join(capsys.readouterr().out.split())
        assert all(option.help.split()[-1] in told for option in study.options)


def test_a_declaration_is_a_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A study declared here runs, is told and is saved; what is not given is the function's own."""
    heard = []

    class Found:
        def save(self, folder: Path) -> None:
            (folder / "found.txt").write_text("yes")

        def __repr__(self) -> str:
            return "found it"

    def look(many: list[str], *, times: int = 3, far: bool = False, near: bool = True) -> Found:
        heard.append((many, times, far, near))
        return Found()

    options = (
        Option("many", "words", "WORD", many="any"),
        Option("--times", "how often", "N", int, 3),
        Option("--far", "in the distance", kind=bool),
        Option("--no-near", "not what is close", kind=bool, parameter="near"),
    )
    declared = Study(
        *("here.look", "look", options, "look"), saves=False, out="found", writes="found.txt"
    )
    monkeypatch.setattr("cosim.cli.studies.studies", lambda: (declared,))
    monkeypatch.setattr(Study, "function", property(lambda self: look))
    out = tmp_path / "new" / "out"
    assert main(["look", "a", "b", f"--out={out}"]) == 0
    assert capsys.readouterr().out == f"found it\nWritten to {out}: found.txt\n"
    assert (out / "found.txt").read_text() == "yes"
    assert main(["look", "c", "--far", "--times=4", "--no-near", f"--out={out}"]) == 0
    assert heard == [(["a", "b"], 3, False, True), (["c"], 4, True, False)]
    assert main(["look", "c", "--times=x"]) == 2
    assert "argument --times: must be a whole number, not 'x'" in capsys.readouterr().err
