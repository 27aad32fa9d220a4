/* Eight lanes at once, for x86-64 processors with AVX-512. */

#ifdef __x86_64__
#define WIDTH 8
#define INLINE static inline __attribute__((always_inline, target("avx512f,avx512dq")))
#define FUNCTION(name) __attribute__((target("avx512f,avx512dq"))) void name##_8
#include "lanes.h"
#endif
