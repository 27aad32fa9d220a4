"""The machine with its coordinates, and its three bodies with the forces on each."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Rectangle
from style import ELECTRIC, FORCE, GREY, INK, MECHANIC, PALE, arrow, canvas, write

SURFACE = "#cfe0f3"
RAM = "#f6d9b8"
PART = "#d5ecd4"
SMALL = 10
BOTH_ENDS = {"lw": 1.0, "arrowstyle": "<|-|>,head_width=0.13,head_length=0.28"}


def block(axes: Axes, left: float, low: float, width: float, height: float, color: str) -> None:
    axes.add_patch(Rectangle((left, low), width, height, facecolor=color, edgecolor=INK, lw=1.3))


def ground(axes: Axes, x: float, low: float, high: float, side: int) -> None:
    """A fixed wall at ``x``; it is hatched on its ``side``, -1 for the left."""
    axes.plot([x, x], [low, high], color=INK, lw=1.8)
    for y in np.arange(low + 0.3, high + 0.01, 0.35):
        axes.plot([x, x + side * 0.3], [y, y - 0.3], color=INK, lw=0.9)


def spring(axes: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    """A zigzag between two points."""
    turns = 5
    first, along = np.array(start), np.subtract(end, start)
    across = 0.16 * np.array([-along[1], along[0]]) / np.hypot(*along)
    share = np.concatenate([[0, 0.12], np.linspace(0.12, 0.88, 2 * turns + 1)[1:-1], [0.88, 1]])
    side = np.concatenate([[0, 0], [(-1) ** n for n in range(2 * turns - 1)], [0, 0]])
    points = first + share[:, None] * along + side[:, None] * across
    axes.plot(*points.T, color=INK, lw=1.2)


def note(axes: Axes, words: str, at: tuple[float, float], of: tuple[float, float]) -> None:
    """Words beside the picture, with a thin line to what they name."""
    line = {"arrowstyle": "-", "color": GREY, "lw": 0.9, "shrinkA": 2, "shrinkB": 0}
    axes.annotate(words, of, at, ha="center", va="center", fontsize=SMALL, arrowprops=line)


def upward(axes: Axes, x: float, low: float, words: str) -> None:
    """A height and its positive direction, from the mark that it is the height of."""
    axes.plot([x - 0.2, x + 0.2], [low, low], color=MECHANIC, lw=1.4)
    arrow(axes, (x, low), (x, low + 0.95), MECHANIC)
    axes.text(x + 0.15, low + 0.72, words, color=MECHANIC, fontsize=14, va="center")


def machine(axes: Axes) -> None:
    low, high, middle, centre = 2.0, 9.0, 5.5, 6.1
    ground(axes, 0.9, low + 0.3, high - 0.3, -1)
    for y in (low + 0.8, high - 0.8):
        axes.plot([0.9, 3.0], [y, y], color=INK, lw=2.6)
    axes.text(
        1.95, middle, "flexures\nto ground\n$k_f$, $c_f$", ha="center", va="center", fontsize=SMALL
    )

    # Housing with its end walls, and the platform that the part touches: one body.
    block(axes, 3.0, low, 5.3, high - low, SURFACE)
    block(axes, 3.6, low + 0.6, 4.1, high - low - 1.2, "white")
    axes.text(5.2, high - 0.31, "wall", ha="center", va="center", fontsize=SMALL)
    axes.text(5.2, low + 0.29, "wall", ha="center", va="center", fontsize=SMALL)
    axes.text(7.1, high + 0.35, "surface, $m_s$: housing and platform", ha="center", fontsize=SMALL)

    # The ram on its suspension, a little above the middle; the coil around it.
    block(axes, 4.6, centre - 1.0, 1.9, 2.0, RAM)
    axes.text(5.12, centre + 0.4, "ram", ha="center", va="center")
    axes.text(5.12, centre - 0.25, "$m_r$", ha="center", va="center", fontsize=13)
    spring(axes, (5.15, centre + 1.0), (5.15, high - 0.6))
    spring(axes, (5.15, low + 0.6), (5.15, centre - 1.0))
    note(axes, "suspension\n$k_1$, $k_2$, $k_3$, $c_m$", (4.3, 1.15), (5.05, low + 1.2))
    for n in range(5):
        y = middle - 0.8 + 0.4 * n
        for x, mark in ((3.95, "x"), (7.35, "o")):
            axes.add_patch(Circle((x, y), 0.17, facecolor="white", edgecolor=ELECTRIC, lw=1.3))
            axes.plot(x, y, mark, color=ELECTRIC, ms=4 if mark == "x" else 2, mew=1.3)
    axes.text(3.75, middle - 1.4, "coil, $i$", color=ELECTRIC, ha="left", fontsize=SMALL)

    # Free travel either way, and the displacement q that it bounds.
    for edge, wall, words in (
        (centre + 1.0, high - 0.6, "travel − $q$"),
        (centre - 1.0, low + 0.6, "travel + $q$"),
    ):
        arrow(axes, (5.7, edge), (5.7, wall), GREY, **BOTH_ENDS)
        axes.text(5.85, (edge + wall) / 2, words, va="center", color=GREY, fontsize=SMALL)
    axes.plot([4.3, 7.0], [middle, middle], color=GREY, lw=1.0, ls=(0, (5, 3)))
    axes.plot([5.7, 6.95], [centre, centre], color=MECHANIC, lw=1.4)
    arrow(
        axes,
        (5.9, middle),
        (5.9, centre),
        MECHANIC,
        arrowstyle="-|>,head_width=0.13,head_length=0.25",
    )
    axes.text(6.02, middle + 0.27, "$q$", color=MECHANIC, fontsize=14, va="center")

    # The part, held against the platform by a plate on a spring.
    block(axes, 8.3, 3.7, 0.75, 3.6, PART)
    axes.text(8.67, 5.85, "part", ha="center", va="center", rotation=90)
    axes.text(8.68, 4.7, "$m_p$", ha="center", va="center", fontsize=12)
    block(axes, 9.05, 4.3, 0.25, 2.4, PALE)
    spring(axes, (9.3, 5.9), (10.9, 5.9))
    ground(axes, 10.9, 4.5, 6.6, 1)
    arrow(axes, (10.7, 5.1), (9.35, 5.1), FORCE)
    axes.text(10.0, 4.72, "$F_n$", color=FORCE, ha="center", va="center", fontsize=14)
    note(axes, "spring-loaded plate\n$\\mu_p$", (10.9, 8.55), (9.2, 6.5))
    note(axes, "friction\n$\\mu_s$, $\\mu_k$", (10.2, 2.6), (8.3, 4.0))

    # Heights are absolute and grow upwards.
    for x, base, words in ((3.3, high, "$z_s$"), (8.67, 7.3, "$z_p$")):
        upward(axes, x, base, words)
    arrow(axes, (6.75, centre), (6.75, centre + 0.95), MECHANIC)
    axes.text(6.62, centre + 1.2, "$z_r$", color=MECHANIC, fontsize=14, va="center")
    axes.text(7.6, 1.15, "$q = z_r - z_s$", color=MECHANIC, fontsize=13, ha="center", va="center")


def body(
    axes: Axes, left: float, width: float, color: str, name: str, up: list[str], down: list[str]
) -> None:
    """A free body with the forces on it, each drawn in the direction in which it is positive."""
    low, high = 4.8, 6.2
    block(axes, left, low, width, high - low, color)
    axes.text(left + width / 2, (low + high) / 2, name, ha="center", va="center")
    for words, start, end in ((up, high, high + 1.1), (down, low, low - 1.1)):
        for n, force in enumerate(words):
            x = left + width * (n + 0.5) / len(words)
            arrow(axes, (x, start), (x, end), FORCE)
            above = end > start
            axes.text(
                x,
                end + (0.12 if above else -0.12),
                force,
                color=FORCE,
                fontsize=12,
                ha="center",
                va="bottom" if above else "top",
            )


def bodies(axes: Axes) -> None:
    body(axes, 12.6, 2.6, RAM, "ram", ["$Bl\\,i$", "$F_m$", "$F_w$"], ["$m_r g$"])
    body(
        axes,
        16.1,
        4.2,
        SURFACE,
        "surface",
        ["$-k_f z_s - c_f \\dot z_s$"],
        ["$Bl\\,i$", "$F_m$", "$F_w$", "$F_f$", "$m_s g$"],
    )
    body(axes, 21.2, 2.4, PART, "part", ["$F_f$", "$F_{plate}$"], ["$m_p g$"])
    axes.text(
        18.1,
        8.55,
        "Forces on each body, drawn in their positive direction",
        ha="center",
        fontsize=SMALL,
    )


def main() -> None:
    figure, axes = canvas(24, 10.6)
    machine(axes)
    bodies(axes)
    write(figure, "machine")


if __name__ == "__main__":
    main()
