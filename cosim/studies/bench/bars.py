"""What each number is to reach, and the table that says whether it does."""

from itertools import groupby
from math import inf
from typing import Any

BARS = {
    "coupled_over_parts.amplifier": (-inf, 1.25),
    "coupled_over_parts.full": (-inf, 1.25),
    "memory_growth": (-inf, 1.25),
    "all_in_ngspice_over_ours": (5.0, inf),
    "naive_over_ours": (4.0, inf),
    "solve_ivp_over_ours": (3.0, inf),
    "real_time.amplifier": (3.0, inf),
    "real_time.limited": (30.0, inf),
    "real_time.ideal": (60.0, inf),
    "real_time.part": (5000.0, inf),
    "cost_exponent": (0.97, 1.03),
    "map_over_bare_calls": (-inf, 1.1),
}
"""Least and greatest median."""

_TITLES = {
    "coupled_over_parts": "Coupled run over the sum of its parts, each alone",
    "all_in_ngspice_over_ours": "The whole machine in one netlist, over ours",
    "naive_over_ours": "PySpice's and fmpy's plain calls, over ours",
    "solve_ivp_over_ours": "SciPy's solve_ivp (LSODA, events), over ours",
    "real_time": "Simulated seconds per second of one core",
    "cost_exponent": "Exponent of the cost over the duration",
    "memory_growth": "Peak memory of a run ten times as long, over that of the shorter",
    "instructions_per_period": "Instructions of the FMU per period",
    "part": "The part on a given surface, exact over published solver",
    "map_over_bare_calls": "CPU time of a sweep over that of bare calls of the compiled loop",
}


def held(numbers: dict[str, Any]) -> dict[str, Any]:
    """The numbers, with ``bar`` and ``holds`` (is the median within it?) where there is a bar."""
    for name, found in _entries(numbers):
        if name in BARS:
            low, high = BARS[name]
            one_sided = f"<= {high:g}" if low == -inf else f">= {low:g}"
            found["bar"] = one_sided if inf in (-low, high) else f"{low:g} ... {high:g}"
            found["holds"] = low <= found["median"] <= high
    return numbers


def table(numbers: dict[str, Any]) -> str:
    """All numbers for people: median, low, high, error, bar, and whether it holds."""
    machine = numbers["machine"]
    lines = [f"{machine['processor']}, {machine['cores']} cores, Python {machine['python']}"]
    for group, entries in groupby(_entries(numbers), lambda entry: entry[0].partition(".")[0]):
        lines.append(f"{_TITLES[group]}:")
        lines += [f"  {name.partition('.')[2]:<10}{_numbers(found)}" for name, found in entries]
    lines.append(f"{_TITLES['part']}:\n  {'':<10}{numbers['part']['ratio']:.4g}")
    count = numbers["instructions_per_period"]
    told = f"{count:,}" if count else "not counted: valgrind is needed"
    lines.append(f"{_TITLES['instructions_per_period']}:\n  {'':<10}{told}")
    return "\n".join(lines)


def _entries(numbers: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Each spread with its dotted name."""
    found = []
    for name, value in numbers.items():
        if isinstance(value, dict) and "median" in value:
            found.append((name, value))
        elif name in ("coupled_over_parts", "real_time"):
            found += [(f"{name}.{case}", spread) for case, spread in value.items()]
    return found


def _numbers(found: dict[str, Any]) -> str:
    told = f"{found['median']:.4g} ({found['low']:.4g} ... {found['high']:.4g})"
    if "error" in found:
        told += f"  error {found['error']:.1e}"
    if "error_of_peer" in found:
        told += f", theirs {found['error_of_peer']:.1e}"
    if "bar" in found:
        told += f"  bar {found['bar']}: {'holds' if found['holds'] else 'MISSED'}"
    return told
