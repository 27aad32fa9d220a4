"""The coupling in time: who steps when, what is passed, an event within a step, a rewind."""

import numpy as np
from matplotlib.axes import Axes
from style import ELECTRIC, FORCE, GREY, INK, MECHANIC, arrow, canvas, write

SMALL = 10
LEFT, RIGHT = 3.4, 23.4
DASHED = (0, (4, 3))


def say(
    axes: Axes, x: float, y: float, words: str, color: str, ha: str = "center", va: str = "center"
) -> None:
    axes.text(x, y, words, color=color, fontsize=SMALL, ha=ha, va=va, linespacing=1.25)


def lanes(axes: Axes, circuit: float, motion: float, names: tuple[str, str]) -> None:
    """The time lines of the two participants."""
    for y, name, what, color in (
        (circuit, "circuit", names[0], ELECTRIC),
        (motion, "mechanics", names[1], MECHANIC),
    ):
        axes.plot([LEFT, RIGHT - 0.3], [y, y], color=color, lw=2.2)
        arrow(axes, (RIGHT - 0.4, y), (RIGHT, y), color, lw=2.2)
        axes.text(LEFT - 0.25, y + 0.22, name, color=color, fontsize=12, ha="right", va="center")
        say(axes, LEFT - 0.25, y - 0.3, what, color, "right")
    say(axes, RIGHT - 0.1, motion - 0.35, "time", GREY, "right")


def instant(axes: Axes, x: float, low: float, high: float, words: str) -> None:
    axes.plot([x, x], [low, high], color=GREY, lw=0.8, ls=DASHED, zorder=0)
    axes.text(x, low - 0.4, words, ha="center", va="center", fontsize=13)


def dot(axes: Axes, x: float, y: float, color: str, filled: bool = True) -> None:
    axes.plot(x, y, "o", ms=8, mec=color, mew=1.8, color=color if filled else "white", zorder=4)


def hop(
    axes: Axes,
    start: float,
    end: float,
    y: float,
    color: str,
    rise: float = 0.55,
    dashed: bool = False,
) -> None:
    """A step along a time line, as an arc above it."""
    share = np.linspace(0, 1, 60)
    x, heights = start + (end - start) * share, y + 0.12 + rise * 4 * share * (1 - share)
    axes.plot(x, heights, color=color, lw=1.5, ls=DASHED if dashed else "-")
    arrow(axes, (x[-2], heights[-2]), (x[-1], heights[-1]), color, lw=1.5)


def step_locked(axes: Axes) -> None:
    """The default: every accepted step of ngspice is a communication point."""
    circuit, motion, low, high = 14.0, 9.9, 9.7, 14.9
    lanes(axes, circuit, motion, ("ngspice", "FMU"))
    axes.text(
        0.5,
        16.75,
        "Step-locked, the default: the circuit leads",
        fontsize=12.5,
        weight="bold",
        va="center",
    )
    t0, t1, t2, t3, event, tried = 4.0, 9.7, 15.2, 21.8, 18.4, 18.2
    for x, words in ((t0, "$t_n$"), (t1, "$t_{n+1}$"), (t2, "$t_{n+2}$"), (t3, "$t_{n+3}$")):
        instant(axes, x, low, high, words)
        dot(axes, x, circuit, ELECTRIC)
        dot(axes, x, motion, MECHANIC)

    hop(axes, t0, t1, circuit, ELECTRIC)
    say(
        axes,
        (t0 + t1) / 2,
        circuit + 1.35,
        "1  circuit steps against\nthe back-EMF $e_n + \\dot e_n\\,(t - t_n)$",
        ELECTRIC,
    )
    arrow(axes, (t1 - 0.25, circuit - 0.3), (7.1, motion + 1.0), ELECTRIC)
    say(axes, 7.75, 12.3, "2  charge of\nthe step,\n$\\int i\\,dt$ in A s", ELECTRIC, "right")
    hop(axes, t0, t1, motion, MECHANIC)
    say(
        axes,
        (t0 + t1) / 2,
        motion - 0.25,
        "3  mechanics step over\nthe same time with\nthe force $Bl\\,i$ in N",
        MECHANIC,
        va="top",
    )
    say(
        axes,
        t1 + 0.2,
        12.1,
        "4  back-EMF in V and\nits slope in V/s,\nfor the next step",
        MECHANIC,
        "left",
    )
    for x in (t1, t2, t3):
        arrow(axes, (x, motion + 0.3), (x, circuit - 0.3), MECHANIC)

    hop(axes, t1, tried, circuit, GREY, 1.0, dashed=True)
    dot(axes, tried, circuit, GREY, filled=False)
    hop(axes, t1, t2, circuit, ELECTRIC, 0.4)
    say(
        axes,
        (t1 + t3) / 2 + 1.2,
        circuit + 1.7,
        "a step that is too long: ngspice rejects it, tries a shorter one;\n"
        "the mechanics never saw it, so there is nothing to undo",
        GREY,
    )
    hop(axes, t1, t2, motion, MECHANIC)
    hop(axes, t2, t3, circuit, ELECTRIC, 0.4)

    axes.plot(event, motion, marker="*", ms=17, color=FORCE, mec="white", zorder=5)
    hop(axes, t2, event, motion, MECHANIC)
    hop(axes, event, t3, motion, MECHANIC)
    say(
        axes,
        (t2 + t3) / 2 + 0.1,
        motion - 0.45,
        "event: part sticks or slips,\nram meets a wall. The FMU\nfinds its instant, goes on",
        FORCE,
        va="top",
    )
    say(
        axes,
        t2 + 0.2,
        12.1,
        "a wall also ends the circuit's\nstep, since the back-EMF\njumps or turns there",
        INK,
        "left",
    )


def macro_steps(axes: Axes) -> None:
    """Communication points of the method's own; a rewind where a participant can be put back."""
    circuit, motion, low, high = 4.6, 2.1, 1.0, 5.0
    lanes(axes, circuit, motion, ("any solver", "any solver"))
    axes.text(0.5, 6.9, "Macro steps: the other methods", fontsize=12.5, weight="bold", va="center")
    t0, t1, t2 = 4.0, 10.6, 17.2
    for x, words in ((t0, "$T_k$"), (t1, "$T_{k+1}$"), (t2, "$T_{k+2}$")):
        instant(axes, x, low, high, words)
        dot(axes, x, circuit, ELECTRIC)
        dot(axes, x, motion, MECHANIC)
    for start in (t0, t1):
        for n in range(4):
            hop(axes, start + 1.65 * n, start + 1.65 * (n + 1), circuit, ELECTRIC, 0.3)
        hop(axes, start, start + 6.6, motion, MECHANIC, 0.5)
    both = {"lw": 1.2, "arrowstyle": "<|-|>,head_width=0.13,head_length=0.28"}
    arrow(axes, (t0, 1.4), (t1, 1.4), INK, **both)
    axes.text((t0 + t1) / 2, 1.0, "macro step $H$ in s", ha="center", va="center", fontsize=SMALL)
    for x in (t1, t2):
        arrow(axes, (x - 0.15, circuit - 0.3), (x - 0.15, motion + 0.3), ELECTRIC)
        arrow(axes, (x + 0.15, motion + 0.3), (x + 0.15, circuit - 0.3), MECHANIC)
    say(axes, t1 - 0.4, 3.55, "current in A, or charge", ELECTRIC, "right")
    say(axes, t1 + 0.45, 3.55, "back-EMF in V", MECHANIC, "left")
    axes.annotate(
        "",
        (t1 + 0.1, 5.0),
        (t2 - 0.1, 5.0),
        arrowprops={
            "arrowstyle": "-|>,head_width=0.2,head_length=0.4",
            "color": FORCE,
            "lw": 1.8,
            "connectionstyle": "arc3,rad=0.16",
        },
    )
    say(
        axes,
        (t1 + t2) / 2,
        6.25,
        "rewind: not agreed at $T_{k+2}$? both go back to $T_{k+1}$ and repeat",
        FORCE,
    )
    say(
        axes,
        17.7,
        3.35,
        "only for participants that can\nbe put back; ngspice cannot",
        FORCE,
        "left",
    )


def main() -> None:
    figure, axes = canvas(24, 17.3)
    step_locked(axes)
    macro_steps(axes)
    write(figure, "coupling")


if __name__ == "__main__":
    main()
