"""The figure of the library's scenes with ports: results/ports.png.

python -m benchmarks.ports
"""

from pathlib import Path

import cosim
from cosim.files.picture import Picture
from cosim.studies.plots import headline

PANELS = {
    "dc-motor": (("gear.speed", 1.0, "rotor [rad/s]"), ("i(Vemf)", 1.0, "current [A]")),
    "relay": (("relay.current", 1e3, "coil [mA]"), ("relay.gap", 1e3, "gap [mm]")),
    "closed-grip": (("rig.z_part", 1e3, "part [mm]"), ("jaw.normal_force", 1.0, "jaw [N]")),
}
"""Two waveforms of each scene: name, factor to the shown unit, and label of the axis."""


def main() -> None:
    figure = Picture(12, 5, layout="constrained")
    panels = figure.subplots(2, len(PANELS), sharex="col", squeeze=False)
    for column, (scene, shown) in enumerate(PANELS.items()):
        waves = cosim.run(scene).columns
        for row, (name, factor, words) in enumerate(shown):
            axes = panels[row, column]
            axes.plot(waves["time"], factor * waves[name], linewidth=0.8)
            axes.set_ylabel(words)
            axes.grid(alpha=0.3)
        panels[0, column].set_title(scene)
        panels[-1, column].set_xlabel("time [s]")
    aim = cosim.load("closed-grip").fmu[2].parameters
    change, end = float(aim["change"]), cosim.load("closed-grip").run.duration
    targets = [1e3 * float(aim[key]) for key in ("target", "target_2")]
    heights = [targets[0], targets[1], targets[1]]
    panels[0, 2].step([0.0, change, end], heights, "k:", where="post", label="asked for")
    panels[0, 2].legend(loc="lower right", frameon=False)
    headline(
        figure,
        "Circuits drive FMUs of their own: friction holds a motor's gear until the bridge turns, a "
        "relay bounces, a grip brings its part to the height asked for",
    )
    figure.write(Path("results/ports.png"))


if __name__ == "__main__":
    main()
