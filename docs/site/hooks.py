"""Pages of the site: Markdown files of the repository at their own paths, files that they link, and the API.

MkDocs calls `on_files` and `on_page_markdown`; mkdocs.yml names this file.
"""

import inspect
import os
import posixpath
import re
from importlib import import_module
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[2]
ABOVE = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "CITATION.cff", "LICENSE", "data/README.md")  # beside docs/
API = ("critique", "datasets", "contact", "effects")  # packages that keep their import paths
MARKED = re.compile(r"^(```\w+) .*$", re.MULTILINE)  # fences with a word for the tests, which MkDocs does not read
LINK = re.compile(r"\]\(([^)#:\s]+)[^)]*\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """The files of docs/ under docs/, those beside it, and an API page for each public package."""
    inside = {f"docs/{file.src_uri}": ROOT / "docs" / file.src_uri for file in files.documentation_pages()}
    pages = inside | {name: ROOT / name for name in ABOVE}
    linked = {}
    for page, path in pages.items():
        if path.suffix == ".md":
            for target in LINK.findall(path.read_text(encoding="utf-8")):
                name = posixpath.normpath(posixpath.join(posixpath.dirname(page), target))
                if name not in pages and not name.startswith("..") and (ROOT / name).is_file():
                    linked[name] = ROOT / name
    theme = [file for file in files if not (file.abs_src_path or "").startswith(os.fspath(ROOT / "docs"))]
    made = [File.generated(config, name, abs_src_path=os.fspath(path)) for name, path in {**pages, **linked}.items()]
    made += [
        File.generated(config, f"api/thesis_lib.{name}.md", content=api_page(f"thesis_lib.{name}")) for name in API
    ]
    return Files([*theme, *made])


def on_page_markdown(markdown: str, **_: object) -> str:
    """The page without what the tests of the tutorials read beside the language of a block."""
    return MARKED.sub(r"\1", markdown)


def api_page(package: str) -> str:
    """Markdown with the docstring of a package and of each public class and function, wherever it is defined."""
    module = import_module(package)
    public = [getattr(module, name) for name in sorted(module.__all__)]
    objects = [item for item in public if inspect.isclass(item) or inspect.isfunction(item)]
    blocks = [f"::: {item.__module__}.{item.__qualname__}" for item in objects]
    text = inspect.getdoc(module) or ""
    return "\n\n".join([f"# {package}", text, *blocks]) + "\n"
