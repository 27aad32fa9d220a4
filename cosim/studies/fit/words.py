"""What a fit prints."""

from typing import Any


def told(numbers: dict[str, Any]) -> str:
    """Fitted or published parameters, trial by trial and together."""
    return _fitted(numbers) if numbers["parameters"] == "fitted" else _published(numbers)


def _fitted(numbers: dict[str, Any]) -> str:
    rows = numbers["trials"]
    width = _width(rows)
    lines = [
        f"{'trial':{width}}  force [m g], 95 %              measured  µ_k F_n [m g], 95 %          "
        "error [mm]"
    ]
    for row in rows:
        force = _number(row, "normal_force", "_weights", ".2f")
        kinetic = _number(row, "kinetic_friction", "_weights", ".2f")
        lines.append(
            f"{row['trial']:{width}}  {force:<29} {_measured(row):>8}  {kinetic:<28} "
            f"{row['mean_error_mm']:>9.3f}"
        )
    found = [f"µ_k {_number(numbers, 'mu_k', '', '.3f')}"]
    static = f"µ_s {numbers['mu_s']:.3g}"
    if "mu_s_95_percent" in numbers:
        found.append(f"{static} {_interval(numbers['mu_s_95_percent'], '.3f')}")
    else:
        found.append(f"{static} given")
    if "mu_plate_95_percent" in numbers:
        interval = _interval(numbers["mu_plate_95_percent"], ".3f")
        found.append(f"µ_plate {numbers['mu_plate']:.3f} {interval}")
    lines += ["; ".join(found), _between(numbers), _mean(numbers), *_changed(numbers)]
    open_ = [row["trial"] for row in rows if row["normal_force_determined"] != "yes"]
    if numbers["mu_k_determined"] != "yes" or open_:
        what = ["µ_k"] * (numbers["mu_k_determined"] != "yes")
        what += [f"the normal force of {', '.join(open_)}"] * bool(open_)
        lines.append(f"Not determined by these trials on either side: {'; '.join(what)}")
    return "\n".join(lines)


def _between(numbers: dict[str, Any]) -> str:
    """How the motion between frames was found, and why so."""
    least = numbers["paths_mean_error_mm"]
    if numbers["between_frames"] == "impacts":
        ratio = "given" if numbers["mass_ratio_given"] else "fitted"
        return (
            f"between frames: impacts of {numbers['impact_duration_s'] * 1e3:.2f} ms; mass of the "
            f"part over the surface's {numbers['mass_ratio']:.2f}, {ratio}"
        )
    return (
        "between frames: straight lines from velocity to velocity, which explain the paths better "
        f"than impacts ({least['straight lines']:.3f} mm against {least['impacts']:.3f} mm); what "
        "they smear is in no interval\n"
        f"leave-one-out error {numbers['leave_one_out_mean_error_mm']:.4f} mm"
    )


def _published(numbers: dict[str, Any]) -> str:
    rows = numbers["trials"]
    width = _width(rows)
    lines = [f"{'trial':{width}}  force [m g]   measured   error [mm]     [%]   sticks"]
    for row in rows:
        lines.append(
            f"{row['trial']:{width}}  {row['normal_force_weights']:>11.2f} {_measured(row):>10} "
            f"{row['mean_error_mm']:>12.3f} {row['mean_error_percent']:>7.2f} "
            f"{100 * row['stick_fraction']:>6.0f} %"
        )
    return "\n".join([*lines, f"µ_k {numbers['mu_k']:.4g}", _mean(numbers), *_changed(numbers)])


def _width(rows: list[dict[str, Any]]) -> int:
    return max(5, *(len(row["trial"]) for row in rows))


def _measured(row: dict[str, Any]) -> str:
    force = row["normal_force_measured_weights"]
    return "–" if force is None else f"{force:.2f}"


def _interval(interval: list[float], form: str) -> str:
    return f"({interval[0]:{form}} … {interval[1]:{form}})"


def _number(numbers: dict[str, Any], name: str, unit: str, form: str) -> str:
    """A number with its interval, or with the end of it that the trials tell."""
    interval, determined = numbers[f"{name}_95_percent"], numbers[f"{name}_determined"]
    if determined == "no":
        return "not determined"
    if determined != "yes":
        return f"{determined} {interval[determined == 'at most']:{form}}"
    return f"{numbers[name + unit]:{form}} {_interval(interval, form)}"


def _mean(numbers: dict[str, Any]) -> str:
    return (
        f"mean error of the heights {numbers['mean_error_mm']:.4f} mm, "
        f"{numbers['mean_error_percent']:.2f} % (straight lines: "
        f"{numbers['straight_line_mean_error_mm']:.4f} mm)"
    )


def _changed(numbers: dict[str, Any]) -> list[str]:
    if numbers["normal_force_change_mean_percent"] is None:
        return []
    return [
        f"normal force off the measured one by {numbers['normal_force_change_mean_percent']:.2f} % "
        f"mean, {numbers['normal_force_change_median_percent']:.2f} % median"
    ]
