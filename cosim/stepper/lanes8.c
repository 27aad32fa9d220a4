/* Eight lanes at once, for x86-64 processors with AVX-512. */

#ifdef __x86_64__
#include <immintrin.h>

#define WIDTH 8
#define INLINE static inline __attribute__((always_inline, target("avx512f,avx512dq")))
#define FUNCTION(name) __attribute__((target("avx512f,avx512dq"))) void name##_8
#define LEAST(a, b) (Wide)_mm512_min_pd((__m512d)(a), (__m512d)(b))
#define MOST(a, b) (Wide)_mm512_max_pd((__m512d)(a), (__m512d)(b))
#define ANY(mask) (_mm512_movepi64_mask((__m512i)(mask)) != 0)
#include "lanes.h"
#endif
