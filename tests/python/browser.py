"""Pages in headless Chromium, each in a frame of a given width: a window of it is never narrower than 500 pixels."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from page_cases import Page

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)

FRAMES = """<!DOCTYPE html>
<meta charset="utf-8">
<body>
<script>
const frames = PAGES.map(([text, width]) => {
  const frame = document.body.appendChild(document.createElement("iframe"));
  frame.style = `border: 0; display: block; height: 900px; width: ${width}px`;
  frame.srcdoc = text;
  return frame;
});
addEventListener("load", () => {
  const look = (page, view) => { LOOK };
  const out = document.body.appendChild(document.createElement("output"));
  out.textContent = JSON.stringify(frames.map(frame => look(frame.contentDocument, frame.contentWindow)));
  for (const frame of frames) frame.remove();
});
</script>
"""


def start(directory: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Run the browser on an address, or for what the options say."""
    command = [
        str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
        "--disable-background-networking", "--disable-component-update", "--enable-logging=stderr", "--virtual-time-budget=2000",
        f"--user-data-dir={directory / 'chromium'}", *options,
    ]  # fmt: skip
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)


def printed_pages(text: str, directory: Path) -> int:
    """How many sheets of paper a page takes."""
    page, paper = directory / "printed.html", directory / "printed.pdf"
    page.write_text(text, encoding="utf-8")
    start(directory, f"--print-to-pdf={paper}", page.as_uri())
    return len(re.findall(rb"/Type\s*/Page\b", paper.read_bytes()))


def seen(pages: Mapping[str, str], widths: Sequence[int], look: str, directory: Path) -> tuple[dict[tuple[str, int], Any], str]:
    """What JavaScript says of each page in frames of each width, and what the browser complained of.

    `look` is the body of a function of ``page``, a document, and ``view``, its window.
    """
    asked = [(name, width) for name in pages for width in widths]
    given = json.dumps([[pages[name], width] for name, width in asked]).replace("</", r"<\/")
    wrapper = directory / "frames.html"
    wrapper.write_text(FRAMES.replace("LOOK", look).replace("PAGES", given), encoding="utf-8")
    done = start(directory, "--dump-dom", wrapper.as_uri())
    told = json.loads(Page(done.stdout).within("output"))
    complaints = "\n".join(line for line in done.stderr.splitlines() if ":CONSOLE" in line)
    return dict(zip(asked, told, strict=True)), complaints
