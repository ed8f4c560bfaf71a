# SPDX-License-Identifier: BSD-3-Clause
"""Opens pages in a headless Chromium, by its own debugging protocol over a pair of pipes."""

import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time


class Browser:
    """One page at a time. Whatever the page complains about is collected in `complaints`."""

    def __init__(self, width=1200, height=800, webgl=True):
        program = shutil.which("chromium") or shutil.which("chromium-browser")
        if program is None:
            raise RuntimeError("no chromium: tools/install-dependencies --all installs it")
        self.complaints = []
        self._profile = tempfile.mkdtemp(prefix="bocst_browser_")
        to_browser, self._out = os.pipe()
        self._in, from_browser = os.pipe()

        def descriptors():  # the protocol wants them at 3 and 4
            low = (os.dup2(to_browser, 20), os.dup2(from_browser, 21))
            os.dup2(low[0], 3)
            os.dup2(low[1], 4)

        self._log = tempfile.TemporaryFile()
        gl = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
        self._process = subprocess.Popen(
            [program, "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--no-first-run",
             "--disable-background-networking", "--disable-extensions", "--remote-debugging-pipe",
             "--user-data-dir=" + self._profile, f"--window-size={width},{height}",
             *(gl if webgl else ["--disable-gpu", "--disable-3d-apis"]), "about:blank"],
            preexec_fn=descriptors, close_fds=False, stdout=self._log, stderr=self._log, stdin=subprocess.DEVNULL)
        os.close(to_browser)
        os.close(from_browser)
        self._buffer = b""
        self._count = 0
        self._events = []
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session = None
        self._session = self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self._call(domain + ".enable")
        self._call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.kill()
        self._process.wait()
        for descriptor in (self._in, self._out):
            os.close(descriptor)
        self._log.close()
        shutil.rmtree(self._profile, ignore_errors=True)

    def open(self, file):
        self._events.clear()
        self._call("Page.navigate", url="file://" + os.path.abspath(file))
        deadline = time.monotonic() + 120
        while not any(e["method"] == "Page.loadEventFired" for e in self._events):
            self._receive(deadline)

    def value(self, expression):
        """The value of a JavaScript expression on the page; promises are waited for."""
        answer = self._call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(json.dumps(answer["exceptionDetails"])[:2000])
        return answer["result"].get("value")

    def settle(self):
        """Until the page has drawn."""
        self.value("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(0))))")

    def choose(self, element, value):
        """As a user sets an input or a selection."""
        self.value(f"(() => {{ const e = document.getElementById('{element}');"
                   f"if (e.type === 'checkbox') e.checked = {json.dumps(value)}; else e.value = {json.dumps(value)};"
                   "e.dispatchEvent(new Event('input', {bubbles: true})); })()")
        self.settle()

    def text(self, element):
        return self.value(f"document.getElementById('{element}').textContent")

    def screenshot(self, file):
        data = self._call("Page.captureScreenshot", format="png")["data"]
        with open(file, "wb") as out:
            out.write(base64.b64decode(data))

    def _call(self, method, **parameters):
        self._count += 1
        message = {"id": self._count, "method": method, "params": parameters}
        if getattr(self, "_session", None):
            message["sessionId"] = self._session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._out, data):]
        deadline = time.monotonic() + 120
        while True:
            answer = self._receive(deadline)
            if answer.get("id") == message["id"]:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]

    def _receive(self, deadline):
        while b"\0" not in self._buffer:
            if not select.select([self._in], [], [], max(0, deadline - time.monotonic()))[0]:
                raise TimeoutError("chromium does not answer")
            data = os.read(self._in, 1 << 16)
            if not data:
                self._log.seek(0)
                raise RuntimeError("chromium ended: " + self._log.read().decode(errors="replace")[-2000:])
            self._buffer += data
        text, self._buffer = self._buffer.split(b"\0", 1)
        message = json.loads(text)
        if "method" in message:
            self._events.append(message)
            self._note(message["method"], message["params"])
        return message

    def _note(self, method, parameters):
        if method == "Runtime.exceptionThrown":
            self.complaints.append(json.dumps(parameters["exceptionDetails"])[:1000])
        elif method == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "warning", "assert"):
            self.complaints.append(json.dumps(parameters["args"])[:1000])
        elif method == "Log.entryAdded" and parameters["entry"]["level"] in ("error", "warning"):
            self.complaints.append(parameters["entry"]["text"])
        elif method == "Network.requestWillBeSent" and not parameters["request"]["url"].startswith(("file:", "data:")):
            self.complaints.append("asks for " + parameters["request"]["url"])
