"""The columns of a campaign's table, beside those of its parameters."""

from __future__ import annotations

PLACE = ("run", "point", "variant", "repeat", "seed")
ERROR = "error"
# Figures of a run against the truth, by the path in the result of `run_trial`. Times are left out: two campaigns of one
# file have the same table.
FIGURES: dict[str, tuple[str, ...]] = {
    "ps": ("truth", "penalty_score"),
    "vrx_score": ("truth", "vrx_score"),
    "distance_mean_m": ("truth", "distance_m", "mean"),
    "distance_std_m": ("truth", "distance_m", "std"),
    "distance_max_m": ("truth", "distance_m", "max_settled"),
    "heading_mean_deg": ("truth", "heading_deg", "mean"),
    "heading_std_deg": ("truth", "heading_deg", "std"),
    "heading_abs_deg": ("truth", "heading_deg", "abs_mean"),
    "ps_measured": ("measured", "penalty_score"),
    "energy_n2": ("energy_n2",),
    "reversals_per_min": ("motors", "reversals_per_min_most"),
    "saturated_share": ("motors", "saturated_share"),
    "change_per_s": ("motors", "change_per_s"),
    "held": ("held",),
}
TAKEN = frozenset((*PLACE, ERROR, *FIGURES))  # names that no parameter can have
