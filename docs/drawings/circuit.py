"""The circuit as the authors' schematic has it and circuits/full.cir plays it."""

import matplotlib.pyplot as plt
import numpy as np
import schemdraw
import schemdraw.elements as e
from style import ELECTRIC, GREY, INK, MECHANIC, write

SMALL, NODE = 10, 9.5


def node(name: str, at: tuple[float, float], loc: str = "top", dot: bool = True) -> e.Element:
    """A node by its name in the netlist."""
    mark = e.Dot(radius=0.06) if dot else e.Dot(radius=0.001)
    return mark.at(at).label(name, loc, fontsize=NODE, color=MECHANIC, ofst=0.12)


def name(words: str, at: tuple[float, float]) -> e.Element:
    return e.Label().at((at[0] - 0.2, at[1])).label(words, "center", fontsize=SMALL)


def title(words: str, at: tuple[float, float]) -> e.Element:
    return e.Label().at(at).label(words, "center", fontsize=SMALL, color=GREY)


def draw(d: schemdraw.Drawing) -> None:
    # Microcontroller: the staircase and the offset pin.
    box = d.add(
        e.Ic(
            pins=[
                e.IcPin("DAC", side="right", slot="2/2", anchorname="dac"),
                e.IcPin("PWM", side="right", slot="1/2", anchorname="pwm"),
            ],
            size=(2.6, 5.4),
            pinspacing=4.6,
            edgepadH=0.4,
        )
    )
    d.add(title("micro-\ncontroller", (box.center[0] - 0.3, box.center[1])))
    d.add(node("dac", box.dac, "top"))
    d.add(node("pwm", box.pwm, "top"))

    # Offset filter and follower.
    r1 = d.add(
        e.Resistor().at(box.pwm).right().length(3.2).label("R1  100 kΩ", "bottom", fontsize=SMALL)
    )
    d.add(node("filtered", r1.end, "top"))
    d.add(e.Capacitor().at(r1.end).down().length(1.9).label("C1\n0.1 µF", "bottom", fontsize=SMALL))
    d.add(e.Ground())
    d.add(e.Line().at(r1.end).right().length(1.1))
    follower = d.add(e.Opamp(leads=False).anchor("in2").scale(0.9))
    d.add(name("LM348", follower.center))
    d.add(e.Line().at(follower.in1).up().length(0.9))
    d.add(e.Line().right().tox(follower.out))
    d.add(e.Line().down().toy(follower.out))
    d.add(e.Line().at(follower.out).right().length(0.8))
    d.add(node("offset", d.here, "top"))

    # Difference amplifier.
    r3 = d.add(e.Resistor().right().length(2.8).label("R3  4.7 kΩ", "bottom", fontsize=SMALL))
    d.add(node("plus", r3.end, "right"))
    d.add(e.Resistor().at(r3.end).down().length(1.9).label("R5\n15 kΩ", "bottom", fontsize=SMALL))
    d.add(e.Ground())
    d.add(e.Line().at(r3.end).up().length(1.35))
    d.add(e.Line().right().length(1.3))
    difference = d.add(e.Opamp(leads=False).anchor("in2"))
    d.add(name("LM348", difference.center))
    d.add(e.Line().at(difference.in1).left().tox(r3.end))
    minus = d.add(e.Line().up().toy(box.dac))
    d.add(node("minus", minus.end, "top"))
    r2 = d.add(
        e.Resistor().at(minus.end).left().length(2.8).label("R2  4.7 kΩ", "bottom", fontsize=SMALL)
    )
    d.add(e.Line().at(r2.end).tox(box.dac))
    v1 = (difference.out[0] + 0.5, difference.out[1])
    d.add(e.Resistor().at(minus.end).right().tox(v1[0]).label("R4  15 kΩ", fontsize=SMALL))
    d.add(e.Line().down().toy(v1[1]))
    d.add(e.Line().at(difference.out).right().tox(v1[0]))
    d.add(node("v1", v1, "bottom"))

    # Power amplifier as current source: its - input sees the sense resistor.
    d.add(e.Line().at(v1).right().length(2.2))
    power = d.add(e.Opamp(leads=False).flip().anchor("in2").scale(1.25))
    d.add(name("OPA548", power.center))
    d.add(e.Arrow(headwidth=0.2).at(power.out).right().length(1.0).label("$i$", color=ELECTRIC))
    d.add(e.Line().right().length(0.8))
    d.add(node("out", d.here, "top"))
    d.add(
        e.Resistor()
        .down()
        .length(1.9)
        .label("coil\n7.1 Ω", "bottom", fontsize=SMALL)
        .color(ELECTRIC)
    )
    d.add(
        e.Inductor(loops=4)
        .down()
        .length(1.9)
        .label("1.2 mH", "bottom", fontsize=SMALL)
        .color(ELECTRIC)
    )
    emf = d.add(
        e.SourceV()
        .down()
        .length(1.9)
        .reverse()
        .label("back-EMF\n$Bl(q)\\,dq/dt$", "bottom", fontsize=SMALL)
        .color(MECHANIC)
    )
    sense = min(emf.start, emf.end, key=lambda end: end[1])
    d.add(node("sense", sense, "right"))
    d.add(e.Resistor().at(sense).down().length(1.9).label("R7\n4 Ω", "bottom", fontsize=SMALL))
    d.add(e.Ground())
    d.add(e.Line().at(sense).left().tox(power.in1[0] - 0.5))
    d.add(e.Line().up().toy(power.in1))
    d.add(e.Line().right().tox(power.in1))

    # What each stage does.
    low = box.pwm[1] - 5.6
    for words, x in (
        ("10-bit staircase,\n0 … 3.3 V", box.center[0]),
        ("offset: filter\nand follower", r1.end[0] + 0.6),
        ("difference amplifier\n$V_1 = 3.19\\,(V_{offset} - V_{DAC})$", difference.center[0] - 1.0),
        ("current source, ±18 V\n$i = V_1 / 4\\,\\Omega$", power.center[0] + 0.1),
    ):
        d.add(title(words, (x, low)))


def main() -> None:
    figure, axes = plt.subplots(figsize=(24 / 2.54, 11.5 / 2.54))
    axes.set_position((0, 0, 1, 1))
    schemdraw.config(fontsize=11, color=INK, lw=1.4, font="DejaVu Sans", mathfont="dejavusans")
    drawing = schemdraw.Drawing()
    draw(drawing)
    drawing.draw(show=False, canvas=axes)
    axes.axis("off")
    axes.set(aspect="equal", xlim=np.add(axes.get_xlim(), (-0.2, 2.3)))
    write(figure, "circuit")


if __name__ == "__main__":
    main()
