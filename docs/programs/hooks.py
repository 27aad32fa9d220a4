"""What MkDocs does besides: pages from outside docs/, their links, and tutorials as notebooks.

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
LINK = re.compile(r"(\]\(|\]: +)(?!\w+:|#|/)([^)#\s]+)(#[^)\s]+)?")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    for pattern in OUTSIDE:
        for path in sorted(REPOSITORY.glob(pattern)):
            if path.is_file():
                own = path.relative_to(REPOSITORY).as_posix()
                files.append(File.generated(config, own, abs_src_path=str(path)))
    bench = html(opened("paper-limited")[0])
    files.append(File.generated(config, "live.html", content=bench))
    for page in files.documentation_pages():
        if page.src_uri.startswith(TUTORIALS) and page.name != "index":
            cells = notebook(page.content_string)
            uri = page.src_uri.replace(".md", ".ipynb")
            files.append(
                File.generated(config, uri, content=cells, inclusion=InclusionLevel.INCLUDED)
            )
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    if page.file.src_uri.startswith(TUTORIALS) and page.file.name != "index":
        head, _, rest = markdown.partition("\n")
        name = posixpath.basename(page.file.src_uri).replace(".md", ".ipynb")
        markdown = f"{head}\n\n*This page is also a [notebook]({name}).*\n{rest}"
    own = Path(page.file.abs_src_path or REPOSITORY).resolve().relative_to(REPOSITORY).parent
    here = posixpath.dirname(page.file.src_uri)

    def moved(match: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(own.as_posix(), match[2]))
        heading = match[3] or ""
        if target == "README.md":  # the repository's front page; the site has its own
            target, heading = "index.md", ""
        return match[1] + posixpath.relpath(target.removeprefix("docs/"), here or ".") + heading

    return LINK.sub(moved, markdown)
