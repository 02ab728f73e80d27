"""Pages of the site as Chromium lays them out: one process for all, a page after the other in an iframe."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from queue import Empty, Queue
from tempfile import TemporaryDirectory

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
LONGEST_S = 300
"""For all pages, on a busy machine."""

MEASURED = """<!doctype html><iframe id="frame" style="border:0;height:900px"></iframe><script>
const pages = PAGES, widths = WIDTHS, found = [];
const wait = (target, name) => new Promise(done => target.addEventListener(name, done, {once: true}));
const cut = p => p.scrollWidth > p.clientWidth + 1;
const plays = film => { const ready = Promise.race([wait(film, "canplay").then(() => true),
  wait(film, "error").then(() => false)]); film.preload = "auto"; film.load(); return ready; };
async function measure() {
  for (const width of widths) for (const page of pages) {
    frame.style.width = `${width}px`;
    const loaded = wait(frame, "load");
    frame.src = page;
    await loaded;
    const d = frame.contentDocument, films = [...d.querySelectorAll("video")];
    const played = [];
    if (width === widths[0]) for (const film of films) played.push(await plays(film));
    const blocks = [...d.querySelectorAll("pre")];
    found.push({page, width, page_width: d.documentElement.scrollWidth, blocks: blocks.length,
      cut: [...d.querySelectorAll("pre, .wide")].filter(cut).map(p => p.textContent),
      copied: d.querySelectorAll("button.copybtn").length,
      films: films.length, still: films.filter((_, i) => played[i] === false).map(f => f.currentSrc)});
  }
  await fetch("WHERE", {method: "POST", mode: "no-cors", body: JSON.stringify(found)});
}
measure();
</script>"""


@dataclass(frozen=True)
class Laid:
    """A page at one width of the window."""

    page: str
    """Its path within the site."""
    width: int
    """Of the window [px]."""
    page_width: int
    """Of the page [px]; more than the window's where it scrolls sideways."""
    blocks: int
    """Blocks of code."""
    cut: tuple[str, ...]
    """Text of the blocks and of the tables of reports that scroll."""
    copied: int
    """Buttons that copy a block."""
    films: int
    """Films on the page."""
    still: tuple[str, ...]
    """Films that do not play."""


def laid_out(site: Path, widths: tuple[int, ...]) -> list[Laid]:
    """Every page at each of the widths, source apart; empty where Chromium does not render.

    Args:
        site: folder of the pages, to which the page that measures is added.
        widths: of the window [px]; films are tried at the first.
    """
    pages = sorted(
        path.relative_to(site).as_posix()
        for path in site.rglob("*.html")
        if not {"_static", "_modules"} & {*path.parts}
    )
    said: Queue[str] = Queue()
    outside = site / "measured.html"
    with _heard(said) as where, TemporaryDirectory() as profile:
        text = MEASURED.replace("PAGES", json.dumps(pages)).replace("WIDTHS", json.dumps(widths))
        outside.write_text(text.replace("WHERE", where), encoding="utf-8")
        command = [str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files",
                   "--disable-background-networking", "--autoplay-policy=no-user-gesture-required",
                   f"--user-data-dir={profile}", outside.as_uri()]  # fmt: skip
        running = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
        try:
            rows = json.loads(said.get(timeout=LONGEST_S))
        except Empty:
            return []
        finally:
            os.killpg(running.pid, signal.SIGKILL)
            running.wait()
            outside.unlink()
    return [Laid(**{name: tuple(v) if isinstance(v, list) else v for name, v in row.items()}) for row in rows]


@contextmanager
def _heard(said: Queue[str]) -> Iterator[str]:
    """An address on this machine; text that is posted there goes into the queue."""

    class Hearing(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            said.put(self.rfile.read(int(self.headers["Content-Length"])).decode())
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Hearing) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
