"""Sweeps: one scene at many settings of its keys."""

from cosim.studies.study import DASK, OVERRIDES, SCENE, SHOW, WORKERS, Option, Study

OVER = Option(
    "--over",
    "a numeric key and its values; repeatable, the last one varies fastest. Where the frequency is "
    "swept, each point lasts whole periods",
    "TABLE.KEY=START:STOP:N|A,B,C",
    many="repeat",
    read="sweep.design.parse",
)
SAMPLES = "N settings from the ranges of the keys, a Latin hypercube, instead of the grid"


def _parts(text: str) -> list[str]:
    """The names between commas, but for those within brackets, as in v(a,b)."""
    parts: list[str] = []
    for part in text.split(","):
        if parts and sum(map(parts[-1].count, "([")) > sum(map(parts[-1].count, ")]")):
            parts[-1] += f",{part}"
        else:
            parts.append(part)
    return parts


STUDIES = (
    Study(
        "sweep.run.sweep",
        "run a scene over a grid or a sample of settings",
        (
            *(SCENE, OVERRIDES, OVER),
            Option("--samples", SAMPLES, "N", int),
            Option("--seed", "of the samples", "N", int, 0),
            Option(
                *("--keep", "also keep these waveforms of every point"),
                *("current,v_surface", _parts),
            ),
            *(WORKERS, DASK, SHOW),
        ),
        command="sweep",
        out="results/<scene>-sweep",
        writes="sweep.nc",
        figures=("figure.png",),
        unit="point",
        tells={
            "progress": lambda done, failed, total: (
                *(done, total),
                f"{failed} failed" if failed else "",
            )
        },
        told="sweep.report.table",
        check="sweep.report.check",
    ),
)
