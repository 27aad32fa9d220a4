/* Four lanes at once, for x86-64 processors with AVX2. */

#ifdef __x86_64__
#include <immintrin.h>

#define WIDTH 4
#define INLINE static inline __attribute__((always_inline, target("avx2")))
#define FUNCTION(name) __attribute__((target("avx2"))) void name##_4
#define LEAST(a, b) (Wide)_mm256_min_pd((__m256d)(a), (__m256d)(b))
#define MOST(a, b) (Wide)_mm256_max_pd((__m256d)(a), (__m256d)(b))
#define ANY(mask) (_mm256_movemask_pd((__m256d)(mask)) != 0)
#include "lanes.h"
#endif
