"""Functions and constants of LTspice and PSpice that ngspice lacks, or defines otherwise."""

import re
from collections.abc import Sequence
from math import pi

from cosim.circuit.dialect.lines import Line
from cosim.circuit.dialect.words import arguments_of, definitions

# The switch's control c, scaled to -0.5 at "off" (f) and 0.5 at "on" (n).
_WAY = "min(max((c-0.5*(n+f))/(n-f),-0.5),0.5)"
FUNCTIONS = {
    "if": ("c,x,y", "ternary_fcn((c)>0.5,x,y)"),
    "limit": ("x,y,z", "min(max(x,min(y,z)),max(y,z))"),
    "uplim": ("x,y,z", "min(x,y-z)+min(max(x-y+z,0),2*z)-min(max(x-y+z,0),2*z)**2/(4*z)"),
    "dnlim": ("x,y,z", "max(x,y+z)-min(max(y+z-x,0),2*z)+min(max(y+z-x,0),2*z)**2/(4*z)"),
    "pow": ("x,y", "ternary_fcn(x<0&&abs(y-2*floor(y/2)-1)<1e-9,-1,1)*(abs(x)+1e-99)**(y)"),
    "pwr": ("x,y", "(abs(x)+1e-99)**(y)"),
    "pwrs": ("x,y", "sgn(x)*(abs(x)+1e-99)**(y)"),
    "arctan": ("x", "atan(x)"),
    "int": ("x", "sgn(x)*floor(abs(x))"),
    "round": ("x", "floor(x+0.5)"),
    "stp": ("x", "u(x)"),
    "buf": ("x", "u(x-0.5)"),
    "inv": ("x", "u(0.5-x)"),
    "mc": ("x,y", "aunif(x,x*(y))"),
    "flat": ("x", "aunif(0,x)"),
    "hypot": ("x,y", "sqrt(x*x+y*y)"),
    "atan2": (
        "y,x",
        "ternary_fcn(x>=0,1,-1)*atan(y/(abs(x)+1e-99))"
        f"+ternary_fcn(x>=0,0,ternary_fcn(y<0,-1,1)*{pi!r})",
    ),
    "fabs": ("x", "abs(x)"),
    "cosim_switch": ("c,n,f,r,q", f"exp(-0.5*ln(r*q)-ln(r/q)*{_WAY}*(1.5-2*{_WAY}**2))"),
    "cosim_diode": ("x,f,b,r,q,d", "x/q+max(x-f,0)*(1/r-1/q)-max(-x-b,0)*(1/d-1/q)"),
}
"""Functions of LTspice and PSpice that ngspice lacks, or defines otherwise in B sources (there
``pwr`` has the sign of x, ``pow`` never a sign): formal parameters, and the body for ngspice. 1e-99
keeps the slope of roots finite at 0. The logarithm of a switch's resistance is a cubic of its
control (Cadence, *PSpice Reference Guide*, voltage-controlled switch)."""
# A name, and the sign behind it by which it is a function, or set or compared.
_NAME = re.compile(r"(?<![\w.])([a-z_]\w*+)(?:\s*(\(|=(?!=)))?")
_CONSTANTS = {"pi": pi, "boltz": 1.380649e-23, "echarge": 1.602176634e-19, "kelvin": -273.15}
"""LTspice's, in J/K, C and degrees Celsius; of ``pi`` B sources know themselves."""
_TEMP = re.compile(r"\.(?:temp\b[\s=]*|opt\w*\s(?:.*[\s,])?temp\s*=\s*)(\{[^{}]*\}|[^\s,]+)", re.I)


def prelude(lines: Sequence[Line]) -> list[Line]:
    """Definitions of the foreign functions and constants that the lines use but do not define."""
    called: dict[str, set[int]] = {}  # numbers of arguments by name
    constants, defined, temperature = set[str](), set[str](), "27"
    for line in lines:
        text = line.text.lower()
        defined.update(each.name for each in definitions(line))
        if temp := _TEMP.match(text):
            temperature = temp[1]
        needs_pi = "{" in text or "'" in text or text.startswith(".param")
        for match in _NAME.finditer(text):
            name, sign = match.groups()
            if sign == "(":
                if name in FUNCTIONS:
                    count = len(arguments_of(text, match.end() - 1)[0])
                    called.setdefault(name, set()).add(count)
            elif (name != "pi" or needs_pi) and (name != "temp" or sign is None):
                constants.add(name)
    found = [
        f".param {name}({formals})={{{body}}}"
        for name, (formals, body) in FUNCTIONS.items()
        if name not in defined and len(formals.split(",")) in called.get(name, ())
    ]
    known = _CONSTANTS | {"temp": temperature}
    found += [f".param {name}={known[name]}" for name in known if name in constants - defined]
    return [Line(text, lines[0].file, 1) for text in found]
