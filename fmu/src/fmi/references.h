/* SPDX-License-Identifier: BSD-2-Clause */
/* Value references, the same in both standards: 0 is time, then the reals and the integers of
 * variables.def in their order. */
#ifndef STICKSLIP_REFERENCES_H
#define STICKSLIP_REFERENCES_H

enum { REFERENCE_TIME = 0, REFERENCE_REALS = 1, REFERENCE_INTEGERS = 1001 };

/* A hash of everything that the FMU is made of, given as -DFMU_TOKEN=hash. The sources inside an
 * .fmu bring it as a file, because FMI 2.0 cannot name compiler definitions. */
#ifndef FMU_TOKEN
#include "token.h"
#endif
#define FMU_TEXT_OF(token) #token
#define FMU_TEXT(token) FMU_TEXT_OF(token)
#define TOKEN_TEXT FMU_TEXT(FMU_TOKEN)

#endif
