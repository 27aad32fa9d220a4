"""LTspice's gates, Schmitt triggers and flip-flops as switches and sources."""

import re
from functools import reduce

from cosim.circuit.dialect.parts import with_memory
from cosim.circuit.dialect.words import number, taken

_GATE = {
    "vhigh": "1", "vlow": "0", "ref": "0.5*(vhigh+vlow)", "vt": "0.5", "vh": "0.01", "td": "0",
    "trise": "0", "tfall": "0", "tau": "0", "rout": "1", "cout": "0", "tripdt": "", "tripv": "",
}  # fmt: skip


def gate(text: str) -> list[str]:
    """LTspice's gate, Schmitt trigger or flip-flop, as a chain: a switch with hysteresis, closed
    while the control is above the middle (an AND's control is its lowest input), a delay, an edge
    of 1 ns or more, and a source for each output. A clocked flip-flop stores its state on two
    capacitors. Inputs at the common node count as not connected."""
    less, given = taken(text, _GATE)
    name, *nodes = less.lower().split()
    if len(nodes) != 9:
        return [text]
    *inputs, below, above, common, kind = nodes
    law = {key: "(" + value.strip("{}'") + ")" for key, value in (_GATE | given).items()}
    law["ref"] = re.sub("v(?:high|low)", lambda match: law[match[0]], law["ref"])
    if kind == "dflop" and inputs[1] == common not in (inputs[0], inputs[2]):
        first = _clocked(name, inputs, common, law["ref"])
        control = f"v({name}_s)", "0.5", "0"
    else:
        first = []
        control = _control(kind, inputs, common, law)
    if control is None:
        return [text]
    # The switch of 1 Ohm and its load of 1 kOhm divide 1 V by 1.001.
    state, td = f"1.001*v({name}_p)", law["td"][1:-1]
    state = state if number(td) == 0.0 else f"delay({state},{{{td}}})"
    found = [
        *first,
        *_held(name, *control),
        *with_memory(f"b{name}_d {name}_d 0 v={state}"),
        f"r{name}_q {name}_d {name}_q 1",
        f"c{name}_q {name}_q 0 {{max(max(1n,{law['trise']})/2.2,{law['tau']})}}",
    ]
    for pin, out, share in ((6, below, f"(1-v({name}_q))"), (7, above, f"v({name}_q)")):
        if out != common:
            level = f"{law['vlow']}+({law['vhigh']}-{law['vlow']})*{share}"
            found.append(f"b{name}_{pin} {name}_{pin} {common} v={level}")
            found.append(f"r{name}_{pin} {name}_{pin} {out} {{{law['rout']}}}")
            found.append(f"c{name}_{pin} {out} {common} {{{law['cout']}}}")
    return found


def _control(
    kind: str, inputs: list[str], common: str, law: dict[str, str]
) -> tuple[str, str, str] | None:
    """The control of the switch, and the middle and half width of its hysteresis; None for a part
    that is not read."""
    x = [f"v({each},{common})" for each in inputs if each != common]
    ref = law["ref"]
    if kind in ("and", "or") and x:
        function = "min" if kind == "and" else "max"
        return reduce(lambda a, b: f"{function}({a},{b})", x), ref, "0"
    if kind == "xor" and len(x) == 2:
        return f"-({x[0]}-{ref})*({x[1]}-{ref})", "0", "0"
    if kind == "schmitt" and (len(x) == 1 or (len(x) == 2 and common not in inputs[:2])):
        return "-".join(x), law["vt"], law["vh"]
    if kind == "srflop" and len(x) == 2 and common not in inputs[:2]:
        return "-".join(x), "0", ref
    return (x[0], ref, "0") if kind == "buf" and len(x) == 1 else None


def _clocked(name: str, inputs: list[str], common: str, ref: str) -> list[str]:
    """The two stores of a flip-flop: NAME_w follows the data while the clock is low, NAME_s follows
    NAME_w while it is high. Each holds its voltage by no current: comparing it with a half instead
    has two solutions."""
    data, preset, clear = (
        f"v({inputs[place]},{common})>{ref}" if inputs[place] != common else "0>1"
        for place in (0, 3, 4)
    )
    high = f"v({name}_c_p)>0.5"
    found = _held(f"{name}_c", f"v({inputs[2]},{common})", ref, "0")
    for each, closed, follows in (("w", f"1-({high})", data), ("s", high, f"v({name}_w)>0.5")):
        own = f"v({name}_{each})"
        aim = f"({closed}) ? (({follows}) ? 1 : 0)-{own} : 0"
        aim = f"{clear} ? 0-{own} : ({preset} ? 1-{own} : ({aim}))"
        found.append(f"b{name}_{each} 0 {name}_{each} i={aim}")
        found += [f"c{name}_{each} {name}_{each} 0 1n", f"r{name}_{each} {name}_{each} 0 1e12"]
    return found


def _held(name: str, y: str, middle: str, half: str) -> list[str]:
    """Elements of a node NAME_p that goes to 1 V where y rises through ``middle`` + ``half``, and
    to 0 where it falls through ``middle`` - ``half``."""
    return [
        f"b{name}_x {name}_x 0 v={y}",
        f"s{name} {name}_1 {name}_p {name}_x 0 {name}_m",
        f".model {name}_m sw vt={{{middle}}} vh={{{half}}} ron=1 roff=1e9",
        f"v{name}_1 {name}_1 0 1",
        f"r{name}_p {name}_p 0 1k",
    ]
