/* Two lanes at once, which every processor of 64 bits can. */

#define WIDTH 2
#define INLINE static inline __attribute__((always_inline))
#define FUNCTION(name) void name##_2
#include "lanes.h"
