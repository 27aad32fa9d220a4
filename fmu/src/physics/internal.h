/* SPDX-License-Identifier: BSD-2-Clause */
/* What the FMU's files share among themselves is declared between these two: it stays out of the
 * library's interface, whatever the compiler options are. An exported name can be taken for one of
 * the host's: glibc, too, has an advance. */
#ifndef STICKSLIP_INTERNAL_H
#define STICKSLIP_INTERNAL_H

#if defined __GNUC__ && !defined _WIN32 /* elsewhere only what is marked is exported */
#define STICKSLIP_INTERNAL_BEGIN _Pragma("GCC visibility push(hidden)")
#define STICKSLIP_INTERNAL_END _Pragma("GCC visibility pop")
#else
#define STICKSLIP_INTERNAL_BEGIN
#define STICKSLIP_INTERNAL_END
#endif

/* What only pays where the compiler unites it with its caller, whose constants it takes. */
#ifdef __GNUC__
#define STICKSLIP_INLINE static inline __attribute__((always_inline))
#else
#define STICKSLIP_INLINE static inline
#endif

/* STICKSLIP_WIDE(result, name, parameters, arguments) makes the function `name` of the inlined one
 * name_any: twice, where the compiler can, for processors with vectors of four doubles and for all.
 * Both compute the same bits: nothing is fused or summed anew. */
#if defined __x86_64__ && defined __GNUC__ && !defined __clang__ && !defined _WIN32
#define STICKSLIP_WIDE(result, name, parameters, arguments)                                        \
    static __attribute__((target("avx2"))) result name##_wide parameters                           \
    {                                                                                              \
        return name##_any arguments;                                                               \
    }                                                                                              \
    result name parameters                                                                         \
    {                                                                                              \
        if (__builtin_cpu_supports("avx2"))                                                        \
            return name##_wide arguments;                                                          \
        return name##_any arguments;                                                               \
    }
#else
#define STICKSLIP_WIDE(result, name, parameters, arguments)                                        \
    result name parameters                                                                         \
    {                                                                                              \
        return name##_any arguments;                                                               \
    }
#endif

#endif
