"""A sandbox that this process closes around itself, irrevocably.

On Linux, Landlock (since 5.13) lets the process read only libraries and the given paths, and write
only its working folder; a seccomp filter denies starting programs and opening sockets. Neither
needs privileges. On other systems only the limits of :func:`_limit` hold. Libraries that read other
files when they start must be loaded before.

Sources: Landlock's user space API and seccomp_data, as linux/landlock.h and linux/seccomp.h of 6.18
have them; the numbers of system calls are those of x86-64 and of arm64.
"""

import ctypes
import os
import platform
import struct
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

_NO_NEW_PRIVILEGES, _SET_SECCOMP, _FILTER = 38, 22, 2  # prctl: options, and a mode of seccomp
_CREATE, _ADD, _RESTRICT = 444, 445, 446  # system calls of Landlock

_EXECUTE, _WRITE, _READ, _LIST = 1, 2, 4, 8
_ON_FILES = _EXECUTE | _WRITE | _READ | 1 << 14  # rights that apply to files, with truncation
_RIGHTS = (13, 14, 15, 15, 16)
"""Number of rights to files that each version of Landlock knows, from version 1 on."""

_FILES, _DEVICES = ("/etc/ld.so.cache", "/etc/localtime"), ("/dev/null", "/dev/urandom")
_SITES = ("site-packages", "dist-packages")

_DENIED = {
    "x86_64": (0xC000003E, """
        41 42 43 49 50 53 288  57 58 59 322  62 129 200 297 424  101 310 311
        141 142 144 251 314  29 30 31 64 65 66 68 69 70 71 220 240 241 242 243 244 245
        253 254 255 294  76 90 91 92 93 94 260 268 452 132 235 261 280 188 189 190 197 198 199
        153 155 159 161 163 164 165 166 167 168 169 170 171 172 173 175 176 179 227 246 248 249 250
        272 298 304 305 308 313 320 321 323 425""", 56, (234, 302, 203)),
    "aarch64": (0xC00000B7, """
        198 199 200 201 202 203 242  221 281  129 130 138 240 424  117 270 271
        140 118 119 30 274  194 195 196 190 191 192 193 186 187 188 189 180 181 182 183 184 185
        26 27 28  45 52 53 54 55 452 88 5 6 7 14 15 16
        39 40 41 51 58 60 89 97 104 105 106 112 142 161 162 170 171 217 218 219 224 225 241 265 266
        268 273 280 282 294 425""", 220, (131, 261, 122)),
}  # fmt: skip
"""By machine: its number in seccomp_data; the denied calls (sockets; new programs; signals to other
processes; their memory; their priorities; shared memory, semaphores and messages; watching files;
truncating files, which Landlock forbids from version 3 on, and their owners, modes, times and
attributes; calls for root only, and io_uring, which would bypass the filter); clone, for threads
only; tgkill, to this process only, and prlimit and sched_setaffinity, for the caller only."""
_CLONE3, _CLONE_THREAD = 435, 0x10000
# Results of the filter: EPERM, ENOSYS, allowed, and the end of the process.
_DENY, _UNKNOWN, _ALLOW, _KILL = 0x50001, 0x50026, 0x7FFF0000, 0x80000000

_OPEN_FILES = 256

lacking: tuple[str, ...] = ()
"""Parts of the fence that this system lacks; set by :func:`close`."""


def close(reads: Iterable[str]) -> None:
    """Close the fence: from now on this process can read only libraries and what lies at or below
    the paths ``reads``, and write only the working folder. Running threads stay outside."""
    global lacking
    _limit()
    if not sys.platform.startswith("linux"):
        lacking = ("Landlock", "seccomp")
        return
    system = ctypes.CDLL(None, use_errno=True)
    system.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    held = {"Landlock": _lock(system, reads), "seccomp": _filter(system)}
    lacking = tuple(name for name, holds in held.items() if not holds)


def _limit() -> None:
    """Limit memory to half of the machine's, forbid core files, allow few open files."""
    with suppress(ImportError):
        import resource

        memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2
        most = {"RLIMIT_DATA": memory, "RLIMIT_CORE": 0, "RLIMIT_NOFILE": _OPEN_FILES}
        for name, limit in most.items():
            kind = getattr(resource, name)
            _, hard = resource.getrlimit(kind)
            limit = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
            with suppress(OSError, ValueError):
                resource.setrlimit(kind, (limit, limit))


def _lock(system: ctypes.CDLL, reads: Iterable[str]) -> bool:
    """Whether Landlock holds from now on."""
    version = system.syscall(_CREATE, None, 0, 1)  # flag 1 asks for the version
    if version < 1:
        return False
    every = (1 << _RIGHTS[min(version, len(_RIGHTS)) - 1]) - 1
    # Rights to files, to TCP ports, and to signals and abstract sockets beyond the fence.
    known = struct.pack("QQQ", every, 3, 3)[: 8 if version < 4 else 16 if version < 6 else 24]
    rules = system.syscall(_CREATE, known, len(known), 0)
    if rules < 0:
        return False
    reading = {*_libraries(), *_FILES, *_DEVICES, *reads}
    allowed = [(path, _READ | _LIST) for path in reading] + [("/dev/null", _WRITE)]
    for path, rights in [*allowed, (os.getcwd(), every & ~_EXECUTE)]:
        with suppress(OSError, ValueError):  # a path that is missing or impossible
            place = os.open(path, os.O_PATH | os.O_CLOEXEC)
            rights &= every if os.path.isdir(path) else _ON_FILES
            system.syscall(_ADD, rules, 1, struct.pack("=Qi", rights, place), 0)
            os.close(place)
    held = system.syscall(_RESTRICT, rules, 0) == 0
    os.close(rules)
    return held


def _libraries() -> set[str]:
    """Folders of loaded packages, of site-packages, and of the loader's search path."""
    packages = [module for name, module in sys.modules.items() if "." not in name]
    found = [place for module in packages for place in getattr(module, "__path__", ())]
    found += [path for path in sys.path if Path(path).name in _SITES]
    found += os.environ.get("LD_LIBRARY_PATH", "").split(":")
    found += [sys.prefix, sys.base_prefix, sys.exec_prefix, "/usr", "/lib", "/lib64"]
    return {path for path in found if os.path.isabs(path)}


def _filter(system: ctypes.CDLL) -> bool:
    """Whether a filter of system calls holds from now on."""
    machine = platform.machine()
    if machine not in _DENIED or sys.maxsize < 1 << 32:
        return False
    name, denied, clone, (tgkill, *own) = _DENIED[machine]
    # An instruction is (code, jump if true, jump if false, operand). Offsets in seccomp_data for
    # loads: 0 the call, 4 the machine, 16 the low half of the first argument.
    load, equal, above, has, end = 0x20, 0x15, 0x35, 0x45, 0x06

    def only(call: int, test: int, value: int) -> list[tuple[int, int, int, int]]:
        """Allow the call if its first argument passes the test, else deny it."""
        return [
            (equal, 0, 4, call), (load, 0, 0, 16), (test, 0, 1, value),
            (end, 0, 0, _ALLOW), (end, 0, 0, _DENY),
        ]  # fmt: skip

    program = [(load, 0, 0, 4), (equal, 1, 0, name), (end, 0, 0, _KILL), (load, 0, 0, 0)]
    program += [(above, 0, 1, 1 << 30), (end, 0, 0, _KILL)]  # x32 calls, a second set of x86-64
    for call in map(int, denied.split()):
        program += [(equal, 0, 1, call), (end, 0, 0, _DENY)]
    program += [(equal, 0, 1, _CLONE3), (end, 0, 0, _UNKNOWN)]  # the C library then tries clone
    program += only(clone, has, _CLONE_THREAD) + only(tgkill, equal, os.getpid())
    for call in own:
        program += only(call, equal, 0)
    program += [(end, 0, 0, _ALLOW)]
    code = b"".join(struct.pack("=HBBI", *step) for step in program)
    kept = ctypes.create_string_buffer(code, len(code))
    given = struct.pack("HxxxxxxP", len(program), ctypes.addressof(kept))
    return system.prctl(_SET_SECCOMP, _FILTER, ctypes.create_string_buffer(given), 0, 0) == 0
