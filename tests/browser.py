"""A headless Chromium for tests of pages, driven over `--remote-debugging-pipe`: no port, no further package.

Messages of the Chrome DevTools Protocol are JSON, each followed by a zero byte; the browser reads descriptor 3 and
writes descriptor 4. All calls wait for their answer; events that come in between are kept in order.
"""

from __future__ import annotations

import base64
import contextlib
import fcntl
import json
import os
import select
import shutil
import signal
import tempfile
import time
from pathlib import Path
from typing import Any

EXECUTABLE = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
ABSENT = "no Chromium on this machine: the page is not looked at in a browser"
TIMEOUT = 60.0  # seconds for any answer; a page of megabytes on a busy machine takes a few
OPTIONS = (
    "--headless",
    "--remote-debugging-pipe",
    "--no-sandbox",  # which needs a user other than root
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--no-first-run",
    "--hide-scrollbars",
)
KEYS = {"Tab": (9, ""), "Enter": (13, "\r"), " ": (32, " "), "ArrowRight": (39, ""), "ArrowDown": (40, "")}
FIRST_DESCRIPTOR = 10  # above those that the browser uses
SHIFT = 8


class Browser:
    """A browser process, ended when the `with` block is left."""

    def __enter__(self) -> Browser:
        assert EXECUTABLE, ABSENT
        self._profile = tempfile.TemporaryDirectory(prefix="chromium-", ignore_cleanup_errors=True)
        to_browser, self._to = map(_high, os.pipe())
        self._from, from_browser = map(_high, os.pipe())
        actions = [
            (os.POSIX_SPAWN_DUP2, to_browser, 3),
            (os.POSIX_SPAWN_DUP2, from_browser, 4),
            *((os.POSIX_SPAWN_OPEN, output, os.devnull, os.O_WRONLY, 0) for output in (1, 2)),
        ]
        arguments = [EXECUTABLE, *OPTIONS, f"--user-data-dir={self._profile.name}", "about:blank"]
        # A session of its own: the browser's many processes are ended as one group.
        self._process = os.posix_spawn(EXECUTABLE, arguments, os.environ, file_actions=actions, setsid=True)
        os.close(to_browser)
        os.close(from_browser)
        self._buffer, self._count = b"", 0
        self.events: list[dict[str, Any]] = []
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError, TimeoutError):
            self.call("Browser.close")
        os.close(self._to)
        os.close(self._from)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process, signal.SIGKILL)
        os.waitpid(self._process, 0)
        self._profile.cleanup()

    def call(self, method: str, session: str | None = None, **parameters: Any) -> dict[str, Any]:
        """Send a command and wait for its result."""
        self._count += 1
        message: dict[str, Any] = {"id": self._count, "method": method, "params": parameters}
        if session:
            message["sessionId"] = session
        _write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._message()
            if answer.get("id") == self._count:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]

    def wait(self, event: str, session: str) -> None:
        """Until an event has come, now or since the last command."""
        while not any(each["method"] == event and each["sessionId"] == session for each in self.events):
            self._message()

    def _message(self) -> dict[str, Any]:
        """The next answer or event; events are kept."""
        until = time.monotonic() + TIMEOUT
        while b"\0" not in self._buffer:
            if not select.select([self._from], [], [], max(0.0, until - time.monotonic()))[0]:
                raise TimeoutError(f"the browser has not answered within {TIMEOUT:.0f} s")
            read = os.read(self._from, 1 << 20)
            if not read:
                raise OSError("the browser has ended")
            self._buffer += read
        text, self._buffer = self._buffer.split(b"\0", 1)
        message = json.loads(text)
        if "method" in message:
            self.events.append({"sessionId": None, **message})
        return message


class Tab:
    """A page opened from a file, in a window of its own size, light or dark."""

    def __init__(
        self, browser: Browser, path: Path, width: int = 1200, height: int = 900, dark: bool = False
    ) -> None:
        self._browser = browser
        target = browser.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network", "Accessibility"):
            self.call(f"{domain}.enable")
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 500,
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        self.call("Page.navigate", url=path.absolute().as_uri())
        browser.wait("Page.loadEventFired", self._session)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """A command to this page."""
        return self._browser.call(method, self._session, **parameters)

    def run(self, expression: str) -> Any:
        """The value of a JavaScript expression."""
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    def press(self, key: str, shift: bool = False) -> None:
        """A key, pressed and released."""
        code, text = KEYS[key]
        common = {"key": key, "windowsVirtualKeyCode": code, "modifiers": SHIFT if shift else 0}
        self.call("Input.dispatchKeyEvent", type="keyDown", text=text, **common)
        self.call("Input.dispatchKeyEvent", type="keyUp", **common)

    def close(self) -> None:
        """Leave the page."""
        self.call("Page.close")

    @property
    def complaints(self) -> list[str]:
        """What stands in the console: errors of scripts, refused resources, messages."""
        return [json.dumps(each["params"]) for each in self._events("Runtime.exceptionThrown")] + [
            json.dumps(each["params"])
            for name in ("Runtime.consoleAPICalled", "Log.entryAdded")
            for each in self._events(name)
        ]

    @property
    def requests(self) -> list[str]:
        """Addresses that the page has asked for, its own and those of data inside it included."""
        return [each["params"]["request"]["url"] for each in self._events("Network.requestWillBeSent")]

    def names(self, role: str) -> list[str]:
        """Names by which a screen reader announces all elements of a role, in order."""
        nodes = self.call("Accessibility.getFullAXTree")["nodes"]
        return [
            node.get("name", {}).get("value", "")
            for node in nodes
            if not node["ignored"] and node["role"]["value"] == role
        ]

    def screenshot(self, path: Path, full: bool = False) -> None:
        """What is in the window, or all of the page, as PNG."""
        data = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=full)["data"]
        path.write_bytes(base64.b64decode(data))

    def print(self, path: Path) -> None:
        """The page on paper, as PDF."""
        path.write_bytes(base64.b64decode(self.call("Page.printToPDF", preferCSSPageSize=True)["data"]))

    def _events(self, name: str) -> list[dict[str, Any]]:
        return [
            event
            for event in self._browser.events
            if event["method"] == name and event["sessionId"] == self._session
        ]


def _high(descriptor: int) -> int:
    """The same pipe under a number that the browser's own descriptors do not hide."""
    found = fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, FIRST_DESCRIPTOR)
    os.close(descriptor)
    return found


def _write(descriptor: int, content: bytes) -> None:
    while content:
        content = content[os.write(descriptor, content) :]
