"""What MkDocs does besides: pages from outside docs/, their links and charts, and tutorials as
notebooks.

A page links to files as they lie in the repository, so that its links work there too. On the site
``docs/`` is the top, and what lies outside of it keeps its path.
"""

import posixpath
import re
import sys
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page

sys.path.insert(0, str(Path(__file__).parent))
from pages import notebook

from cosim.live.page import html, opened

REPOSITORY = Path(__file__).parents[2]
OUTSIDE = (
    "results/*.md",
    "results/*.png",
    "results/*.csv",
    "results/*.json",
    "circuits/**/*",
    "fmu/README.md",
    "fmu/src/physics/variables.def",
    "fmu/models/*.c",
    "fmu/thin/*.h",
    "cosim/studies/identify/problem/bounds.toml",
    "CHANGELOG.md",
    "SECURITY.md",
    "LICENSE",
    "fmu/LICENSE",
    "CITATION.cff",
    "CONTRIBUTING.md",
    "CODE_OF_CONDUCT.md",
)
"""What the site takes from outside docs/, where it is there."""

TUTORIALS = "tutorials/"
LIVE = "live.html"
"""The page of ``cosim live``, which only the site has."""

LINK = re.compile(r"(\]\(|\]: +)(?!\w+:|#|/)([^)#\s]+)(#[^)\s]+)?")
IMAGE = re.compile(r"(<a [^>]*>\s*)?(<img [^>]*?src=\"([^\"]+)\"[^>]*>)")
ROW = re.compile(r"^\| (\[.*?) \| (.*?) \|", re.MULTILINE)
CHART = re.compile(r"\]\(([^)]+\.png)\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    for pattern in OUTSIDE:
        for path in sorted(REPOSITORY.glob(pattern)):
            if path.is_file():
                own = path.relative_to(REPOSITORY).as_posix()
                files.append(File.generated(config, own, abs_src_path=str(path)))
    bench = html(opened("paper-limited")[0])
    files.append(File.generated(config, LIVE, content=bench))
    for page in files.documentation_pages():
        if page.src_uri.startswith(TUTORIALS) and page.name != "index":
            cells = notebook(built(linked(page.content_string, page), page, files))
            uri = page.src_uri.replace(".md", ".ipynb")
            files.append(
                File.generated(config, uri, content=cells, inclusion=InclusionLevel.INCLUDED)
            )
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    head, _, rest = markdown.partition("\n")
    if page.file.src_uri.startswith(TUTORIALS) and page.file.name != "index":
        name = posixpath.basename(page.file.src_uri).replace(".md", ".ipynb")
        markdown = f"{head}\n\n*This page is also a [notebook]({name}).*\n{rest}"
    if page.file.src_uri.startswith("results/"):
        markdown = "\n\n".join([head, *charts(page.file.name, files), rest])
    return linked(markdown, page.file)


def on_page_content(content: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """A picture leads to itself, to be seen in full size."""

    def leading(match: re.Match[str]) -> str:
        inside, picture, source = match.groups()
        return match[0] if inside else f'<a class="picture" href="{source}">{picture}</a>'

    return IMAGE.sub(leading, content)


def linked(markdown: str, page: File) -> str:
    """A page's text with its links as they lead on the site, to pages by their sources."""
    own = Path(page.abs_src_path or REPOSITORY).resolve().relative_to(REPOSITORY).parent
    here = posixpath.dirname(page.src_uri) or "."

    def moved(match: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(own.as_posix(), match[2]))
        heading = match[3] or ""
        if target == "README.md":  # the repository's front page; the site has its own
            target, heading = "index.md", ""
        return match[1] + posixpath.relpath(target.removeprefix("docs/"), here) + heading

    live = posixpath.relpath(LIVE, here)
    return LINK.sub(moved, markdown).replace(f"`{LIVE}`", f"[`{LIVE}`]({live})")


def built(markdown: str, page: File, files: Files) -> str:
    """A page's text with its links to the pages as they are built."""
    here = posixpath.dirname(page.src_uri)

    def moved(match: re.Match[str]) -> str:
        target = files.get_file_from_path(posixpath.normpath(posixpath.join(here, match[2])))
        to = match[2] if target is None else posixpath.relpath(target.dest_uri, here or ".")
        return match[1] + to + (match[3] or "")

    return LINK.sub(moved, markdown)


def charts(name: str, files: Files) -> list[str]:
    """The charts that a page of results/ is about, by the words of its gallery: the first one, and
    what leads to the others."""
    gallery = files.get_file_from_path("results/README.md")
    rows = ROW.findall(gallery.content_string if gallery else "")
    first, *others = [
        f"[{words}]({chart})"
        for cell, words in rows
        for chart in CHART.findall(cell)
        if re.fullmatch(rf"{re.escape(name)}(-\w+)?\.png", chart)
    ] or [""]
    return [f"!{first}" if first else "", f"Also as charts: {'; '.join(others)}." if others else ""]
