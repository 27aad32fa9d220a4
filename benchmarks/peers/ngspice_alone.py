"""A peer: the whole machine as one netlist, as a user of ngspice alone would write it.

Mechanics as capacitors and B sources, in mm and mm/s: friction made smooth by tanh, walls by
Hunt-Crossley as in the FMU. The command comes from the same compiled source as in our own run, and
the same compiled log takes what ngspice sends, so only the mechanics differ.
"""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from time import process_time

import numpy as np

from benchmarks.parts import replay
from cosim.arrays import Array
from cosim.circuit.joined import Deck
from cosim.circuit.netlist import prepare
from cosim.coupling.loop.lead import Lead
from cosim.coupling.loop.recorder import Recorder
from cosim.drive.command import command
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene

CREEP = 5e-7
"""m/s; the slip velocity at which the smoothed friction is at 76 % of its value."""

STRIBECK = 30 * CREEP
"""m/s; over which it falls from the static to the kinetic coefficient. Narrower ones lower the
break-away force, wider ones lose more to the friction in between."""

_MOST_STEPS = 5_000_000

_MECHANICS = """\
Vemf c3 emf 0
Bemf emf sense V={force_factor}*1e-3*(v(ram)-v(surface))
Bslip slip 0 V=v(surface)-v(part)
Bfriction friction 0 V={force}*tanh(v(slip)/{creep})*({mu_k}+{more}*exp(-(v(slip)/{stribeck})**2))
Bwall wall 0 V={wall}
Bdrive drive 0 V={force_factor}*i(Vemf)+v(wall)-{suspension}
Bram 0 ram I=1e3*(v(drive)-{ram_mass}*{gravity})
Bsurface 0 surface I=-1e3*(v(drive)+1e-3*({flexure_stiffness}*v(z)+{flexure_damping}*v(surface))\
+v(friction)+{surface_mass}*{gravity})
Bpart 0 part I=1e3*(v(friction)-{part_mass}*{gravity})
Bq 0 q I=v(ram)-v(surface)
Bz 0 z I=v(surface)
Bp 0 p I=v(part)
Cram ram 0 {ram_mass} ic=0
Csurface surface 0 {surface_mass} ic=0
Cpart part 0 {part_mass} ic=0
Cq q 0 1 ic={q}
Cz z 0 1 ic={z}
Cp p 0 1 ic={z}"""


def _netlist(scene: Scene, rest: dict[str, float]) -> Deck:
    """The deck with the mechanics in it; ``rest`` are the heights (m) in equilibrium."""
    deck = prepare(scene)
    saved = ("i(vemf)", "v(p)")
    own = {"vemf": _mechanics(scene, rest), ".save": f".save {' '.join(saved)}"}
    lines = [own.get(line.split()[0], line) for line in deck.text.splitlines()]
    # The trapezoidal rule is the better one for a mechanism.
    lines = [line.replace("method=gear", "method=trap") for line in lines]
    text = "\n".join(f"{x} uic" if x.startswith(".tran ") else x for x in lines)
    return replace(deck, text=text, vectors={name: name for name in saved})


def run(scene: Scene, times: Sequence[float]) -> tuple[float, Array]:
    """CPU seconds, and the part's height (m) at ``times`` (s)."""
    began = process_time()
    with closing(Mechanics(scene)) as mechanics:
        recorder = Recorder(scene, mechanics, lambda _: None)
        still = np.tile((0.0, 0.0, np.inf), (_MOST_STEPS, 1))
        deck = _netlist(scene, mechanics.sample())
        circuit = Lead(scene, command(scene), recorder, deck)
        replay(circuit, still)
        circuit.run()
    log = circuit.log()
    path = np.interp(times, log["time"], 1e-3 * log["v(p)"])
    return process_time() - began, path


def _mechanics(scene: Scene, rest: dict[str, float]) -> str:
    table = scene.mechanics
    upper = f"uramp(v(q)-{1e3 * table.travel!r})"
    lower = f"uramp(-v(q)-{1e3 * table.travel!r})"
    rate = f"{table.contact_damping!r}*1e-3*(v(ram)-v(surface))"
    stiffness = table.contact_stiffness * 1e-3**1.5
    return _MECHANICS.format(
        **table.model_dump(exclude={"contact", "suspension"}),
        force_factor=repr(scene.coil.force_factor),
        force=repr(scene.friction.normal_force),
        mu_k=repr(scene.friction.mu_k),
        more=repr(scene.friction.mu_s - scene.friction.mu_k),
        creep=repr(1e3 * CREEP),
        stribeck=repr(1e3 * STRIBECK),
        wall=f"{stiffness!r}*({lower}**1.5*uramp(1-{rate})-{upper}**1.5*uramp(1+{rate}))",
        suspension=(
            f"(1e-3*v(q)*({table.suspension_k1!r}+1e-3*v(q)*({table.suspension_k2!r}"
            f"+1e-3*v(q)*{table.suspension_k3!r}))"
            f"+{table.suspension_damping!r}*1e-3*(v(ram)-v(surface)))"
        ),
        q=repr(1e3 * (rest["z_ram"] - rest["z_surface"])),
        z=repr(1e3 * rest["z_surface"]),
    )
