/* Four lanes at once, for x86-64 processors with AVX2. */

#ifdef __x86_64__
#define WIDTH 4
#define INLINE static inline __attribute__((always_inline, target("avx2")))
#define FUNCTION(name) __attribute__((target("avx2"))) void name##_4
#include "lanes.h"
#endif
