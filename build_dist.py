"""Makes what a release has, in `dist/`: `make dist`.

    ngcosim-VERSION.tar.gz      the source distribution
    ngcosim-VERSION-*.whl       a wheel for each of PLATFORMS, made of it alone
    stickslip-fmi2.fmu and -fmi3.fmu  the FMU with the binaries of all of them
    SHA256SUMS                  a hash of each

zig compiles for all of them on one machine, and the same sources give the same bytes.
"""

import gzip
import hashlib
import os
import shutil
import struct
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

import build_c
from cosim.files.atomic import whole
from cosim.mechanics import package

DIST = build_c.ROOT / "dist"
DATE = "315532800"
"""1980-01-01, the first day that a zip file knows, for whatever is dated in an archive."""


@dataclass(frozen=True)
class Platform:
    name: str
    """In FMI 3.0."""
    zig: str
    """As zig names it, with the oldest system that what is made runs on."""
    wheel: str
    """As a wheel's name has it."""
    fmi2: str
    """The folder of the FMU for FMI 2.0, which names no platform with an ARM processor: importers
    on macOS look into one folder for both processors, others into one named as in FMI 3.0."""


PLATFORMS = (
    Platform("x86_64-linux", "x86_64-linux-gnu.2.17", "manylinux2014_x86_64", "linux64"),
    Platform("aarch64-linux", "aarch64-linux-gnu.2.17", "manylinux2014_aarch64", "aarch64-linux"),
    Platform("x86_64-darwin", "x86_64-macos.11.0", "macosx_11_0_x86_64", "darwin64"),
    Platform("aarch64-darwin", "aarch64-macos.11.0", "macosx_11_0_arm64", "darwin64"),
    Platform("x86_64-windows", "x86_64-windows-gnu", "win_amd64", "win64"),
)


def main() -> None:
    zig = f"{sys.executable} -m ziglang cc"
    shutil.rmtree(DIST, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix="cosim-dist-") as name:
        work = Path(name)
        build("--sdist", build_c.ROOT, work)
        (sdist,) = work.glob("*.tar.gz")
        with tarfile.open(sdist) as archive:
            archive.extractall(work, filter="data")
        sources = sdist.with_name(sdist.name.removesuffix(".tar.gz"))
        pack(sources, sdist)
        wheels = {}
        for platform in PLATFORMS:
            print(f"{platform.name}: compiling, and making the wheel", flush=True)
            wheels[platform] = wheel(platform, sources, work / platform.name, zig)
        fmus = [fmu(version, wheels, work) for version in package.VERSIONS]
        DIST.mkdir()
        for path in (sdist, *wheels.values(), *fmus):
            shutil.move(path, DIST)
    made = sorted(DIST.iterdir())
    sums = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in made]
    (DIST / "SHA256SUMS").write_text("".join(sums))
    for path in made:
        print(f"{path.stat().st_size:9d}  dist/{path.name}")


def pack(folder: Path, target: Path) -> None:
    """A tar file of a folder, with nothing in it of when, where and by whom it was made."""

    def plain(info: tarfile.TarInfo) -> tarfile.TarInfo:
        info.mtime, info.uid, info.gid, info.uname, info.gname = int(DATE), 0, 0, "", ""
        info.mode = 0o755 if info.isdir() or info.mode & 0o100 else 0o644
        return info

    with (
        target.open("wb") as file,
        gzip.GzipFile("", "wb", fileobj=file, mtime=0) as packed,
        tarfile.open(fileobj=packed, mode="w") as archive,
    ):
        archive.add(folder, folder.name, filter=plain)


def build(kind: str, folder: Path, out: Path, *options: str, **environment: str) -> None:
    """Call the builder, in an environment of its own with nothing else in it."""
    command = [sys.executable, "-m", "build", "-q", kind, "--outdir", str(out), *options]
    environment["SOURCE_DATE_EPOCH"] = DATE
    done = subprocess.run([*command, str(folder)], env=os.environ | environment, check=False)
    if done.returncode:
        sys.exit("cosim: the distributions could not be built (see above).")


def wheel(platform: Platform, sources: Path, out: Path, zig: str) -> Path:
    """The wheel for one platform."""
    shutil.rmtree(sources / "build", ignore_errors=True)
    option = f"-C--build-option=--plat-name={platform.wheel}"
    cross = {"COSIM_TARGET": platform.name, "CC_FOR_BUILD": zig}
    # -s: no table of names that nothing needs, and on Windows no file for the debugger.
    build("--wheel", sources, out, option, CC=f"{zig} -target {platform.zig} -s", **cross)
    (made,) = out.glob("*.whl")
    return made


def fmu(version: int, wheels: dict[Platform, Path], work: Path) -> Path:
    """One FMU of the same in all wheels, whose binaries alone differ."""
    folder = work / f"fmi{version}"
    binaries: dict[str, list[bytes]] = {}
    for platform, path in wheels.items():
        prefix = f"cosim/_compiled/fmi{version}/"
        with zipfile.ZipFile(path) as archive:
            for name in archive.namelist():
                if not name.startswith(prefix):
                    continue
                data, target = archive.read(name), folder / name.removeprefix(prefix)
                if target.parent.parent.name == "binaries":
                    place = platform.fmi2 if version == 2 else platform.name
                    binaries.setdefault(f"binaries/{place}/{target.name}", []).append(data)
                elif not target.exists():
                    target.parent.mkdir(parents=True, exist_ok=True)
                    target.write_bytes(data)
                elif target.read_bytes() != data:
                    sys.exit(f"cosim: {target.name} of the FMU differs between two platforms.")
    for name, parts in binaries.items():
        (folder / name).parent.mkdir(parents=True)
        (folder / name).write_bytes(parts[0] if len(parts) == 1 else universal(parts))
    made = work / f"{package.MODEL}-fmi{version}.fmu"
    with whole(made) as target:
        package.zipped(folder, target)
    return made


def universal(parts: list[bytes]) -> bytes:
    """A library of macOS for several processors: theirs, each on a page of its own, after a table
    of them (mach-o/fat.h)."""
    page = 1 << 14  # the larger one of both
    table, content = struct.pack(">II", 0xCAFEBABE, len(parts)), b""
    for part in parts:
        content += bytes(-len(content) % page)
        processor = struct.unpack_from("<II", part, 4)
        table += struct.pack(">5I", *processor, page + len(content), len(part), 14)
        content += part
    return table.ljust(page, b"\0") + content


if __name__ == "__main__":
    main()
