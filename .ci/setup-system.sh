#!/bin/sh
# Brings the machine and .venv to where pip can take over; called by `make setup`.
#
# Looks for what is missing of libngspice, a C compiler and Python's venv module, installs
# that and nothing else (apt-get or Homebrew), and makes .venv. Prints a line per stage.
set -eu
cd "$(dirname "$0")/.."

say() { printf '%s\n' "$*"; }
die() { printf 'cosim set-up: %s\n' "$*" >&2; exit 1; }

log=$(mktemp)
trap 'rm -f "$log" "$log.out"' EXIT
trap 'exit 130' INT TERM

# --- Python ---------------------------------------------------------------------------------

good_python() {
    command -v "$1" >/dev/null 2>&1 &&
        "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1
}

find_python() {
    if [ -n "${PYTHON:-}" ]; then
        good_python "$PYTHON" || die "PYTHON=$PYTHON is not a Python 3.11 or newer."
        python=$PYTHON
        return
    fi
    for python in python3 python3.13 python3.12 python3.11; do
        if good_python "$python"; then return; fi
    done
    if command -v python3 >/dev/null 2>&1; then
        die "Python 3.11 or newer is needed, and python3 here is $(python3 -c \
            'import platform; print(platform.python_version())' 2>/dev/null ||
            printf 'not working'); install a newer one, or name it: make PYTHON=/path/to/python3 ..."
    fi
    die "Python 3.11 or newer is needed, and no python3 was found; please install it."
}

# --- what is there --------------------------------------------------------------------------

have_ngspice() {
    "$python" - <<'PY' >/dev/null 2>&1
import ctypes, os, sys
names = [
    os.environ.get("NGSPICE_LIBRARY_PATH"),
    "libngspice.so.0", "libngspice.so",
    "libngspice.dylib", "/opt/homebrew/lib/libngspice.dylib", "/usr/local/lib/libngspice.dylib",
]
for name in filter(None, names):
    try:
        ctypes.CDLL(name)
    except OSError:
        continue
    sys.exit(0)
sys.exit(1)
PY
}

have_compiler() {
    # On a bare macOS, calling cc opens a dialog: ask first whether the tools are there.
    if [ "$system" = Darwin ] && ! xcode-select -p >/dev/null 2>&1; then return 1; fi
    # ${CC} may carry flags, so it is split.
    printf '#include <math.h>\nint main(void) { return 0; }\n' |
        ${CC:-cc} -x c -o "$log.out" - >/dev/null 2>&1
}

have_venv() { "$python" -c 'import ensurepip, venv' >/dev/null 2>&1; }

# --- installing it --------------------------------------------------------------------------

as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi
}

apt() {
    as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq -y \
        -o Dpkg::Use-Pty=0 -o DPkg::Lock::Timeout=300 "$@" >"$log" 2>&1 </dev/null
}

apt_install() {
    if [ "$(id -u)" != 0 ]; then
        command -v sudo >/dev/null 2>&1 ||
            die "please have an administrator install these packages, then try again: $*"
        # Without a terminal nobody can type a password.
        sudo -n true 2>/dev/null || { [ -t 0 ] && sudo -v; } ||
            die "sudo is not to be had here; please have these packages installed, then try again: $*"
    fi
    say "Installing $* (apt-get)"
    apt update || { sed -n '$p' "$log" >&2; say "  package lists not refreshed, going on" >&2; }
    apt install --no-install-recommends "$@" ||
        { tail -n 5 "$log" >&2; die "apt-get could not install: $* (no network? on Ubuntu, is 'universe' enabled?)"; }
}

install_debian() {
    packages=
    have_ngspice || packages="$packages libngspice0"
    have_compiler || packages="$packages gcc libc6-dev"
    have_venv || packages="$packages python$("$python" -c \
        'import sys; print("%d.%d" % sys.version_info[:2])')-venv"
    [ -n "$packages" ] || return 0
    # shellcheck disable=SC2086
    apt_install ${packages# }
}

install_macos() {
    have_compiler ||
        die "a C compiler is needed; please run 'xcode-select --install', then try again."
    if ! have_ngspice; then
        command -v brew >/dev/null 2>&1 ||
            die "libngspice is needed; please install Homebrew (then this does the rest) or libngspice."
        say "Installing libngspice (Homebrew)"
        HOMEBREW_NO_AUTO_UPDATE=1 HOMEBREW_NO_ENV_HINTS=1 brew install -q libngspice \
            >"$log" 2>&1 </dev/null ||
            { tail -n 5 "$log" >&2; die "Homebrew could not install libngspice."; }
    fi
}

check_all() {
    missing=
    have_ngspice || missing="${missing:+$missing, }the ngspice shared library (libngspice)"
    have_compiler || missing="${missing:+$missing, }a C compiler with the C library's headers"
    have_venv || missing="${missing:+$missing, }Python's venv and ensurepip modules ($python)"
    [ -z "$missing" ] || die "please install, then try again: $missing."
}

system=$(uname -s)
find_python
if [ "$system" = Darwin ]; then
    install_macos
elif command -v apt-get >/dev/null 2>&1; then
    install_debian
fi
check_all

# --- .venv ----------------------------------------------------------------------------------

# A finished environment names its folder; one that was moved, or whose Python went, is made anew.
if [ ! -x .venv/bin/python ] || [ "$(cat .venv/.created 2>/dev/null)" != "$(pwd)" ]; then
    say "Making .venv ($("$python" -c 'import platform; print("Python", platform.python_version())'))"
    "$python" -m venv --clear .venv || die "Python could not make .venv."
fi
pwd >.venv/.created
