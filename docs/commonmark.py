"""CommonMark: lets MkDocs read pages as GitHub reads them, and find the pictures that lie outside of the book.

Python-Markdown begins a list only behind an empty line and nests by four spaces; CommonMark needs neither. Pictures are links to `traces/`,
relative to the page, so that they show without building; here they become files of the site.
"""

import re
from pathlib import Path

from mkdocs.structure.files import File

TOP = Path(__file__).resolve().parent.parent
MARKER = re.compile(r"( *)([-*]|\d+\.) +(?=\S)")
PICTURE = re.compile(r"\]\((?:\.\./)+(traces/[^)]+\.png)\)")


def on_files(files, config):
    """Adds the pictures that pages show."""
    shown = set()
    for page in files.documentation_pages():
        shown.update(PICTURE.findall(page.content_string))
    for picture in sorted(shown):
        files.append(File.generated(config, picture, abs_src_path=str(TOP / picture)))
    return files


def on_page_markdown(markdown, page, config, files):
    """Lists as Python-Markdown wants them, pictures where the site has them."""
    up = "../" * page.file.src_uri.count("/")
    return PICTURE.sub(lambda found: f"]({up}{found[1]})", lists(markdown))


def lists(markdown):
    """An empty line before each list; each level of nesting four spaces deep."""
    out, levels, fenced = [], [], False
    for line in markdown.split("\n"):
        if line.lstrip().startswith("```"):
            fenced = not fenced
        marker = None if fenced else MARKER.match(line)
        within = bool(levels)
        depth = len(line) - len(line.lstrip())
        if line.strip() and not (fenced and not levels):
            # Levels whose text begins further to the right are over, but for lazy lines of a paragraph.
            while levels and depth < levels[-1] and (marker or not out[-1].strip()):
                levels.pop()
        if marker:
            if not within and out and out[-1].strip():
                out.append("")
            out.append("    " * len(levels) + line.lstrip())
            levels.append(marker.end())
        elif levels and line.strip():
            out.append("    " * len(levels) + line[min(depth, levels[-1]):])
        else:
            out.append(line)
    return "\n".join(out)
