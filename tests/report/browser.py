"""Headless Chromium by its DevTools protocol, over two pipes: no driver, no network."""

import base64
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

CHROMIUM = shutil.which("chromium")
_FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--hide-scrollbars",
    "--disable-background-networking",
    "--disable-component-update",
    "--remote-debugging-pipe",
)


class Browser:
    """One page of a headless Chromium; a context manager."""

    def __enter__(self):
        # Chromium reads commands from descriptor 3 and answers on 4, each message ended by a zero.
        theirs, self._to = os.pipe()
        self._from, back = os.pipe()
        self._home = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        flags = " ".join((*_FLAGS, f"--user-data-dir={self._home.name}"))
        self._process = subprocess.Popen(
            ["bash", "-c", f"exec {CHROMIUM} {flags} 3<&{theirs} 4>&{back}"],
            pass_fds=(theirs, back),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(theirs)
        os.close(back)
        self._rest, self._n, self._session, self.messages = b"", 0, None, []
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        attached = self.ask("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.ask(f"{domain}.enable")
        return self

    def __exit__(self, *_):
        os.close(self._to)
        self._process.kill()
        self._process.wait()
        os.close(self._from)
        self._home.cleanup()

    def ask(self, method, **params):
        """Send one command and return its result."""
        self._n += 1
        message = {"id": self._n, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        rest = json.dumps(message).encode() + b"\0"
        while rest:
            rest = rest[os.write(self._to, rest) :]
        while (found := self._next()).get("id") != self._n:
            self._keep(found)
        if "error" in found:
            raise RuntimeError(f"{method}: {found['error']}")
        return found["result"]

    def open(self, path, width, height=800, *, scheme="light"):
        """Load a file in a window of that size; afterwards `messages` are those of its console."""
        self.messages = []
        self.ask(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 600,
        )
        media = [{"name": "prefers-color-scheme", "value": scheme}]
        self.ask("Emulation.setEmulatedMedia", features=media)
        self.ask("Page.navigate", url=Path(path).absolute().as_uri())
        while self._keep(self._next()) != "Page.loadEventFired":
            pass

    def run(self, script):
        """Return the value of a script, a promise's when it is kept."""
        found = self.ask(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in found:
            raise RuntimeError(found["exceptionDetails"])
        return found["result"].get("value")

    def pdf(self, path):
        """Write the page as it would be printed on A4, and return how many sheets that takes."""
        data = self.ask("Page.printToPDF", paperWidth=8.27, paperHeight=11.69)["data"]
        content = base64.b64decode(data)
        Path(path).write_bytes(content)
        return content.count(b"/Type /Page\n") or content.count(b"/Type/Page\n")

    def _next(self):
        while b"\0" not in self._rest:
            more = os.read(self._from, 1 << 20)
            if not more:
                raise RuntimeError("Chromium ended")
            self._rest += more
        found, _, self._rest = self._rest.partition(b"\0")
        return json.loads(found)

    def _keep(self, event):
        method = event.get("method")
        if method in ("Runtime.exceptionThrown", "Log.entryAdded", "Runtime.consoleAPICalled"):
            self.messages.append(event["params"])
        return method
