"""Numbers published with the ten tracked trials, which `cosim fit` uses and compares with.

Source: C. Yako, J. Nowak, S. Yuan, K. Salisbury, *Vertical Vibratory Transport of Grasped Parts
Using Impacts*, and `matlab/parameter_estimation.m` of the repository
clyako/vertical-vibratory-transport-of-grasped-parts-using-impacts that belongs to it, which has
the forces, the fitted numbers with all their digits, and the bounds of the fit. Forces are in
weights of the part, m g, for the trials 1…10.
"""

GRAVITY = 9.81  # m/s²

MU_S = 0.72  # measured, and kept in the fit
MU_K = 0.59  # measured
MU_K_FITTED = 0.6234

TRIALS = tuple(f"Trial #{n}" for n in range(1, 11))
"""The names of the trials' files, without an ending."""
FORCES_MEASURED = (11.089, 16.901, 5.278, 5.278, 5.278, 5.278, 5.278, 5.278, 5.278, 22.841)
FORCES_FITTED = (
    *(10.6500, 13.0009, 9.9833, 6.7872, 6.0413),
    *(7.0798, 6.2765, 6.6180, 7.1825, 8.2225),
)
FORCE_BOUNDS = (
    *((4.0, 16.0), (12.8, 19.2), (4.0, 16.0), (4.9, 7.3), (4.9, 7.3)),
    *((4.9, 7.3), (4.9, 7.3), (4.56, 6.84), (4.0, 8.0), (8.0, 24.0)),
)
