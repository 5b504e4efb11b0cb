"""The system's Chromium without a window, driven by selenium, on the live page."""

import base64
import json
import shutil
import tempfile
import time
from pathlib import Path

import numpy as np
from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

# Seconds until something that must happen has to have happened. It only ends what hangs.
DEADLINE = 60.0
# Nothing that asks for anything from elsewhere.
FLAGS = [
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--disable-dev-shm-usage", "--hide-scrollbars",
]
SIZES = {"desktop": (1360, 1180, 1, False), "phone": (390, 844, 2, True)}


class Page:
    """The live page in a browser."""

    def __init__(self, link, pictures):
        self.pictures = Path(pictures)
        self.profile = tempfile.mkdtemp()
        options = webdriver.ChromeOptions()
        options.binary_location = shutil.which("chromium")
        for flag in [*FLAGS, f"--user-data-dir={self.profile}"]:
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        self.driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
        self.size("desktop")
        self.driver.get(link)

    def __enter__(self):
        return self

    def __exit__(self, failure, *_):
        """Ends the browser; it must have had nothing to complain of, such as what its policy forbids."""
        try:
            told = [line["message"] for line in self.driver.get_log("browser") if line["level"] == "SEVERE"]
            assert failure or not told, told
        finally:
            self.driver.quit()
            shutil.rmtree(self.profile, ignore_errors=True)

    def size(self, name):
        width, height, ratio, mobile = SIZES[name]
        metrics = {"width": width, "height": height, "deviceScaleFactor": ratio, "mobile": mobile}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        self.driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": mobile})

    def scheme(self, name):
        features = [{"name": "prefers-color-scheme", "value": name}]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})

    def picture(self, name, whole=False):
        """A PNG of what the window shows, or of the whole page."""
        time.sleep(0.3)
        shot = self.driver.execute_cdp_cmd("Page.captureScreenshot", {"captureBeyondViewport": whole})
        (self.pictures / f"{name}.png").write_bytes(base64.b64decode(shot["data"]))

    def script(self, text, *arguments):
        return self.driver.execute_script(text, *arguments)

    def find(self, selector):
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def text(self, selector):
        return self.script("return document.querySelector(arguments[0]).innerText", selector)

    def wait(self, condition, what):
        """Waits until the condition gives something, and gives that."""
        end = time.monotonic() + DEADLINE
        while not (result := condition()):
            assert time.monotonic() < end, f"{what}: not within {DEADLINE} s; events: {self.text('#events')}"
            time.sleep(0.02)
        return result

    def shown(self):
        """What is on the screen, all of one moment: the frame's stamp and size, where the picture is on the page, and the
        boxes there by id, each as left, top, width, height."""
        return self.script("""
            const sides = (e) => { const r = e.getBoundingClientRect(); return [r.x, r.y, r.width, r.height]; };
            const overlay = document.getElementById("overlay");
            return {
              stamp: overlay.dataset.stamp ? overlay.dataset.stamp : null,
              size: overlay.getAttribute("viewBox").split(" ").slice(2).map(Number),
              picture: sides(document.getElementById("frame")),
              boxes: Object.fromEntries([...overlay.querySelectorAll("[data-id]")].map((e) => [e.dataset.id, sides(e)])),
            };""")

    def pixels(self):
        """What is shown, and the pixels of the picture at that moment: rows x columns x RGB."""
        found = self.script("""
            const canvas = document.getElementById("frame");
            const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
            let text = "";
            for (let i = 0; i < data.length; i += 8192) text += String.fromCharCode(...data.subarray(i, i + 8192));
            return [document.getElementById("overlay").dataset.stamp, canvas.width, canvas.height, btoa(text)];""")
        stamp, width, height, data = found
        pixels = np.frombuffer(base64.b64decode(data), dtype=np.uint8).reshape(height, width, 4)
        return stamp, pixels[:, :, :3]

    def scroll_to_picture(self):
        self.script("document.getElementById('watch').scrollIntoView({block: 'start'})")

    def on_page(self, rect):
        """Where a box of the frame is on the page: left, top, width, height."""
        shown = self.shown()
        (left, top, width, height), (w, h) = shown["picture"], shown["size"]
        x, y = width / w, height / h
        return left + rect[0] * x, top + rect[1] * y, rect[2] * x, rect[3] * y

    def drag(self, rect):
        """Draws a box of the frame with the mouse."""
        left, top, width, height = self.on_page(rect)
        self.mouse(("move", left, top), "press", ("move", left + width / 2, top + height / 3),
                   ("move", left + width, top + height), "release")

    def click(self, x, y):
        """Clicks on a point of the page."""
        self.mouse(("move", x, y), "press", "release")

    def mouse(self, *deeds):
        chain = ActionChains(self.driver, duration=20)
        for deed in deeds:
            pointer = chain.w3c_actions.pointer_action
            if deed == "press":
                pointer.pointer_down()
            elif deed == "release":
                pointer.pointer_up()
            else:
                pointer.move_to_location(round(deed[1]), round(deed[2]))
        chain.perform()

    def moment(self, kind):
        """How bright the middle of the picture is of the newest event of this kind, if there is one."""
        return self.script("""
            const items = [...document.querySelectorAll("#events li")];
            const image = items.find((li) => li.querySelector("b." + arguments[0]))?.querySelector("img");
            if (!image?.complete || !image.naturalWidth) return null;
            const [w, h] = [image.naturalWidth, image.naturalHeight];
            const pen = new OffscreenCanvas(w, h).getContext("2d");
            pen.drawImage(image, 0, 0);
            const { data } = pen.getImageData(0.45 * w, 0.4 * h, 0.1 * w, 0.2 * h);
            return data.reduce((sum, value, i) => (i % 4 < 3 ? sum + value : sum), 0) / (data.length * 0.75);""", kind)

    def touch(self, rect):
        """Draws a box of the frame with a finger."""
        left, top, width, height = self.on_page(rect)
        self.finger((left, top), (left + width / 2, top + height / 3), (left + width, top + height))

    def finger(self, *points):
        """A finger goes down at the first of these points of the page, over the others, and up."""
        for kind, (x, y) in zip(["touchStart"] + ["touchMove"] * (len(points) - 1), points):
            self.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": x, "y": y}]})
        self.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})

    def fill(self, field, text):
        """Types a text in the place of what is in the field, which is never empty meanwhile."""
        field.send_keys(Keys.CONTROL, "a")
        field.send_keys(text, Keys.ENTER)

    def keys(self, *keys):
        ActionChains(self.driver).send_keys(*keys).perform()


__all__ = ["Page", "By", "Keys", "json", "np", "time", "Path"]
