/* Eight lanes at once, for x86-64 processors with AVX-512. */

#ifdef __x86_64__
#define WIDTH 8
#define INLINE static inline __attribute__((always_inline, target("avx512f,avx512dq")))
#define RUN __attribute__((target("avx512f,avx512dq"))) void chain_lanes_8
#include "lanes.h"
#endif
