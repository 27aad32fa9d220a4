"""Finds the settings that transport best, as the operator does by ear; and how a small turn of
each knob changes a run's mean velocity, for ``cosim run --spread``."""

from cosim.studies.study import DASK, OVERRIDES, SCENE, SEED, WORKERS, Option, Study

OVER = Option(
    "--over",
    "a numeric key and its range; repeatable (default: the three knobs, end to end)",
    "TABLE.KEY=LOW:HIGH",
    many="repeat",
    read="tune.found.ranges_of",
)

STUDIES = (
    Study(
        "tune.run.tune",
        "find the settings that transport best",
        (
            *(SCENE, OVERRIDES),
            Option("--maximise", "a number of the summary to make large: v_average, …", "NAME"),
            Option("--minimise", "a number to make small; one of the two is needed", "NAME"),
            OVER,
            Option("--budget", "number of settings to run, for each waveform", "N", int, 200),
            Option(
                "--waveform",
                "search each of these by itself, with the numbers of its shape: sawtooth, "
                "falling-sawtooth, sine, square, steps:N, pieces:N with N levels",
                "NAME,...",
                kind=lambda names: names.split(","),
            ),
            Option("--polarity", "search both polarities of the coil", kind=bool),
            Option(
                "--robust",
                "search by the median over all turns of the keys by 2 % (by the worst where signs "
                "differ): 15 runs a setting of three knobs",
                kind=bool,
            ),
            Option(
                "--heat",
                "largest heat of a coil, W, or largest rise of the winding's temperature, K, with "
                "the share of on-time and the time on, s (default: 3.5 W, the most that the drives "
                "of the Carlton's data sheet make)",
                "W|K:DUTY:SECONDS",
            ),
            *(SEED, WORKERS, DASK),
        ),
        command="tune",
        out="results/<scene>-tune",
        writes="tune.json, tune.csv, best.toml",
        figures=("figure.png",),
        unit="run",
        total="budget",
        tells={
            "progress": lambda run, best: (None, None, f"{best.value:.4g}" if best else ""),
            "scouting": lambda run, best: (
                *(0, None),
                "without ngspice" + (f", {best.value:.4g}" if best else ""),
            ),
        },
    ),
    Study("tune.spread.spread"),
)
