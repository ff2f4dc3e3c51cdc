"""Pages of the site: Markdown files and notebooks of the repository at their own paths, files that they link, the API.

MkDocs calls `on_files` and `on_page_markdown`; mkdocs.yml names this file.
"""

import inspect
import os
import posixpath
import re
from importlib import import_module
from pathlib import Path

import nbconvert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[2]
ABOVE = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "CITATION.cff", "LICENSE", "data/README.md")  # beside docs/
API = ("critique", "datasets", "contact", "effects")  # packages that keep their import paths
MARKED = re.compile(r"^(```\w+) .*$", re.MULTILINE)  # fences with a word for the tests, which MkDocs does not read
LINK = re.compile(r"\]\(([^)#:\s]+)[^)]*\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """The files of docs/ under docs/, those beside it, notebooks, and an API page for each public package."""
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
    for path in sorted(ROOT.glob("notebooks/*.ipynb")):
        made += [File.generated(config, name, content=content) for name, content in notebook(path).items()]
    return Files([*theme, *made])


def notebook(path: Path) -> dict[str, str | bytes]:
    """A notebook as a page with the pictures in it, by their paths in the site."""
    body, resources = nbconvert.MarkdownExporter().from_filename(path)
    pictures = {name: f"{path.stem}_{name}" for name in resources["outputs"]}
    for name, unique in pictures.items():
        body = body.replace(f"]({name})", f"]({unique})")
    page = path.relative_to(ROOT).with_suffix(".md")
    of_page = {page.with_name(unique).as_posix(): resources["outputs"][name] for name, unique in pictures.items()}
    return {page.as_posix(): body, **of_page}


def on_page_markdown(markdown: str, **_: object) -> str:
    """The page without what the tests of the tutorials read beside the language of a block, and links to notebooks."""
    return MARKED.sub(r"\1", markdown).replace(".ipynb)", ".md)")


def api_page(package: str) -> str:
    """Markdown with the docstring of a package and of each public class and function, wherever it is defined."""
    module = import_module(package)
    public = [getattr(module, name) for name in sorted(module.__all__)]
    objects = [item for item in public if inspect.isclass(item) or inspect.isfunction(item)]
    blocks = [f"::: {item.__module__}.{item.__qualname__}" for item in objects]
    text = inspect.getdoc(module) or ""
    return "\n\n".join([f"# {package}", text, *blocks]) + "\n"
