"""A user with a browser, a camera and a listener; see `tests/browser.rs`."""

import sys
import threading

from long_term_tracker.msg import Track
from parameters import AsyncParameterClient, parameter_value_to_python
from peer import *  # noqa: F403

from chromium import *  # noqa: F403
from script import run

# Frames a second, how much of the scene's own pace they have, and its size.
RATE = 15
PACE = 0.4
SIZE = (640, 480)
TARGET = (80, 96)
# Pixels on the page, and overlaps.
NEAR = 2.0
LANDED = 0.9
HELD = 0.5


class Camera(threading.Thread):
    """A peer that sends images at their rate, and listens, on a thread of its own."""

    def __init__(self):
        super().__init__(daemon=True)
        self.peer = Peer()
        self.peer.scene = Scene(*SIZE, TARGET)
        self.said = {}
        self.ends = False
        self.start()

    def run(self):
        peer, due, index = self.peer, time.monotonic(), 0
        while not self.ends:
            index += 1
            peer.images.publish(image_message(peer.scene.rgb(index * PACE), "rgb8", index))
            due = max(due + 1 / RATE, time.monotonic() - 1)
            while (left := due - time.monotonic()) > 0 and not self.ends:
                peer.executor.spin_once(timeout_sec=left)
            for message in peer.tracks:
                self.said[nanos(message)] = message
            peer.tracks.clear()

    def box(self, stamp):
        """Where the target is on the image of this stamp."""
        index = round((int(stamp) - 1_000_000_000_000) / 33_333_333)
        return self.peer.scene.box(index * PACE)

    def newest(self):
        return self.said[max(self.said)] if self.said else None

    def parameter(self, name):
        """The value as rclpy's client gets it."""
        client = AsyncParameterClient(self.peer.node, "/tracker")
        future = client.get_parameters([name])
        end = time.monotonic() + DEADLINE
        while not future.done():
            assert time.monotonic() < end, f"parameter {name} is not told"
            time.sleep(0.01)
        return parameter_value_to_python(future.result().values[0])


def nanos(message):
    sec, nanosec = stamp_of(message)
    return sec * 1_000_000_000 + nanosec


def near(a, b, what):
    assert max(abs(p - q) for p, q in zip(a, b)) <= NEAR, f"{what}: {a} and {b}"


def live(link, pictures):
    """A target is marked late, watched, tuned and stopped on the page."""
    page = Page(link, pictures)
    page.wait(lambda: "live" == page.text("#connection"), "the connection")
    page.wait(lambda: "no image on /image" in page.text("#banner"), "the hint what is waited for")
    page.picture("waiting")
    camera = Camera()
    page.wait(lambda: page.shown()["stamp"], "the first picture")
    page.wait(lambda: not page.find("#banner").is_displayed(), "the hint is gone")

    mark_late(page, camera)
    boxes_are_in_their_place(page, camera)
    follow_through_the_sizes(page)
    tune(page, camera)
    refuse(page)
    rename_and_stop(page, camera)
    mark_by_keys(page, camera)
    page.close()
    camera.ends = True
    camera.join()


def mark_late(page, camera):
    """A mark that is dragged half a second after its frame came lands on that frame."""
    page.find("#freeze").click()
    frozen = page.shown()["stamp"]
    time.sleep(0.5)
    assert page.shown()["stamp"] == frozen, "the picture stands still"
    box = camera.box(frozen)
    page.drag(box)
    page.wait(lambda: camera.newest().tracks, "the target is followed")
    assert page.shown()["stamp"] == frozen
    event = page.wait(lambda: "marked" in page.text("#events"), "the event of the mark")
    page.find("#freeze").click()
    passed = (max(camera.said) - int(frozen)) / 33_333_333
    now = camera.newest()
    overlap = iou(box_of(now.tracks[0]), camera.box(nanos(now)))
    moved = iou(box, camera.box(nanos(now)))
    print(f"marked {passed:.0f} frames late; overlap now {overlap:.2f}, of the box as it was drawn {moved:.2f}")
    assert event and passed > 0.4 * RATE and overlap > HELD, (passed, overlap)


def boxes_are_in_their_place(page, camera):
    """The box on the page is the track of the frame on the page, and where the target is in the picture."""
    checked, worst = 0, 0.0
    while checked < 5:
        shown = page.shown()
        said = camera.said.get(int(shown["stamp"]))
        if said is None or not said.tracks or said.tracks[0].id not in shown["boxes"]:
            continue
        (left, top, width, height), (w, h) = shown["picture"], shown["size"]
        x, y, bw, bh = box_of(said.tracks[0])
        wanted = (left + x * width / w, top + y * height / h, bw * width / w, bh * height / h)
        near(shown["boxes"][said.tracks[0].id], wanted, "the box and the track of its frame")
        worst = max(worst, *(abs(p - q) for p, q in zip(shown["boxes"][said.tracks[0].id], wanted)))
        stamp, pixels = page.pixels()
        found = find(pixels, camera.peer.scene.patch, camera.box(stamp), pixels.shape[1] / w)
        scaled = [side * width / w for side in found], [side * width / w for side in camera.box(stamp)[:2]]
        near(*scaled, "the target in the picture")
        checked += 1
        time.sleep(0.1)
    print(f"boxes on the page lie within {worst:.2f} px of their tracks")


def find(pixels, patch, around, zoom):
    """Where the patch is in the picture near a box, in pixels of the frame."""
    assert zoom == 1.0, "the test's picture has the size of the frame"
    best = None
    for dy in range(-8, 9):
        for dx in range(-8, 9):
            x, y = around[0] + dx, around[1] + dy
            part = pixels[y : y + patch.shape[0], x : x + patch.shape[1]]
            if part.shape == patch.shape:
                difference = np.abs(part.astype(int) - patch).mean()
                if best is None or difference < best[0]:
                    best = difference, (x, y)
    assert best[0] < 20, f"the target is not in the picture: {best}"
    return best[1]


def follow_through_the_sizes(page):
    """Pictures for people to look at; nothing is cut off on a narrow screen."""
    slider = page.find("#layers input[type=range]")
    time.sleep(3)
    for scheme in ("light", "dark"):
        page.scheme(scheme)
        for size in ("desktop", "phone"):
            page.size(size)
            page.picture(f"{size}-{scheme}", whole=size == "phone")
            wide = page.script("return document.documentElement.scrollWidth - document.documentElement.clientWidth")
            assert wide <= 0, f"{size}: {wide} px are cut off"
    page.scheme("light")
    page.size("desktop")
    page.script("arguments[0].value = 0.5; arguments[0].dispatchEvent(new Event('input'))", slider)
    page.picture("response")
    page.script("arguments[0].value = 0; arguments[0].dispatchEvent(new Event('input'))", slider)


def tune(page, camera):
    """A slider moves a parameter; a refused one says why at its field; the change is taken back."""
    name = "lcmht.confidence.patience"
    before = camera.parameter(name)
    page.find("#search").send_keys(name)
    page.wait(lambda: page.find(f"[data-name='{name}'] input[type=range]").is_displayed(), "the parameter is found")
    page.find(f"[data-name='{name}'] input[type=range]").send_keys(*[Keys.ARROW_RIGHT] * 80)
    after = page.wait(lambda: (value := camera.parameter(name)) != before and value, "rclpy sees another value")
    assert after > before, (before, after)
    is_changed = lambda: "is-changed" in page.find(f"[data-name='{name}']").get_attribute("class")
    page.wait(is_changed, "the change is marked")
    page.picture("tuned")
    page.find("#undo").click()
    page.wait(lambda: camera.parameter(name) == before, "the change is taken back")
    page.wait(lambda: not is_changed(), "it is marked no more")

    page.find("#search").clear()
    page.find("#search").send_keys("levels.black")
    field = page.find("[data-name='levels.black'] input[type=number]")
    field.clear()
    field.send_keys("65535", Keys.ENTER)
    told = lambda: page.text("[data-name='levels.black'] .error")
    why = page.wait(told, "the refusal is told at the field")
    assert "levels.black and levels.white are both 65535" in why, why
    page.find("#search").clear()
    page.find("#search").send_keys(Keys.ESCAPE)


def refuse(page):
    """A mark that is too small says why, where it was drawn."""
    page.scroll_to_picture()
    page.drag((300, 200, 20, 2))
    why = page.wait(lambda: page.find("#bubble").is_displayed() and page.text("#bubble"), "the refusal")
    assert "is too small" in why or "is too thin" in why, why
    page.picture("refused")


def rename_and_stop(page, camera):
    """A click on the target picks it; it is called otherwise, and then stopped."""
    page.scroll_to_picture()

    def pick():
        page.keys(Keys.ESCAPE)
        left, top, width, height = next(iter(page.shown()["boxes"].values()))
        page.click(left + width / 2, top + height / 2)
        return page.script("return document.querySelector('#targets .picked')?.dataset.id ?? null")

    page.wait(pick, "the target is picked")
    box = page.find("#targets .picked form input")
    box.clear()
    box.send_keys("the walker", Keys.ENTER)
    page.wait(lambda: [t.id for t in camera.newest().tracks] == ["the walker"], "the new name")
    page.wait(lambda: "the walker" in page.shown()["boxes"], "the new name on the page")
    is_picked = lambda: page.script("return document.querySelector('#targets .picked')?.dataset.id") == "the walker"
    page.wait(is_picked, "the target is still picked")
    page.picture("picked")
    page.find("#targets .picked .stop").click()
    page.wait(lambda: not camera.newest().tracks, "the target is stopped")
    page.wait(lambda: not page.shown()["boxes"], "its box is gone")


def mark_by_keys(page, camera):
    """M, arrows and Enter mark without a mouse; Escape takes back."""
    page.script("document.activeElement.blur()")
    page.keys("m")
    page.wait(lambda: page.script("return document.querySelectorAll('#overlay .draft').length"), "the box")
    page.keys(Keys.ESCAPE)
    page.wait(lambda: not page.script("return document.querySelectorAll('#overlay .draft').length"), "it is taken back")
    page.keys("m", Keys.ARROW_LEFT, Keys.ENTER)
    page.wait(lambda: camera.newest().tracks, "the target is followed")


def frames(folder, count):
    """Writes the scene's images as files."""
    scene = Scene(*SIZE, TARGET)
    for index in range(int(count)):
        height, width, _ = (rgb := scene.rgb(index * PACE)).shape
        header = f"P6 {width} {height} 255\n".encode()
        (Path(folder) / f"{index:04}.ppm").write_bytes(header + rgb.tobytes())


def recording(link, pictures, bag):
    """A target is marked in a recording, which is played, gone back in, run again with another parameter, and saved."""
    page = Page(link, pictures)
    scene = Scene(*SIZE, TARGET)
    page.driver.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": pictures})
    place = lambda: page.script("return [...document.getElementById('frames').innerText.matchAll(/[0-9]+/g)].map(Number)")
    page.wait(lambda: page.shown()["stamp"] == "0", "the first frame")
    page.drag(scene.box(0))
    page.wait(lambda: page.shown()["boxes"], "the target is followed")
    page.find("#forth").click()
    page.wait(lambda: page.shown()["stamp"] == "1", "one step")
    page.find("#play").click()
    page.wait(lambda: place()[0] == place()[1], "the end")
    last = page.wait(lambda: (s := page.shown())["stamp"] == str(place()[1] - 1) and s, "the last frame")
    near(last["boxes"]["0"], page.on_page(scene.box((place()[1] - 1) * PACE)), "the target at the end")
    page.picture("recording")

    # Back along the strip, to the middle.
    left, top, width, height = page.script("""
        const r = document.getElementById("strip").getBoundingClientRect(); return [r.x, r.y, r.width, r.height];""")
    page.script("window.scrollTo(0, document.getElementById('strip').getBoundingClientRect().top + scrollY - 200)")
    left, top, width, height = page.script("""
        const r = document.getElementById("strip").getBoundingClientRect(); return [r.x, r.y, r.width, r.height];""")
    page.click(left + width / 2, top + height / 2)
    middle = page.wait(lambda: (s := page.shown()) and abs(int(s["stamp"]) - place()[1] // 2) <= 1 and s, "the middle")
    near(middle["boxes"]["0"], page.on_page(scene.box(int(middle["stamp"]) * PACE)), "the target in the middle")

    # Tuned and run again: the same mark, and the run before stays on the strip.
    page.find("#search").send_keys("lcmht.filter.learning_rate")
    field = page.find("[data-name='lcmht.filter.learning_rate'] input[type=number]")
    field.clear()
    field.send_keys("0.05", Keys.ENTER)
    field_of = "[data-name='lcmht.filter.learning_rate']"
    page.wait(lambda: "is-changed" in page.find(field_of).get_attribute("class"), "the parameter is changed")
    page.find("#again").click()
    page.wait(lambda: place()[2] == 2 and place()[0] == place()[1], "the second run ends")
    page.picture("run-again")
    page.find("#rows").click()
    rows = Path(pictures) / "tracks.csv"
    page.wait(rows.exists, "the rows")
    lines = page.wait(lambda: len(got := rows.read_text().splitlines()) == place()[1] + 1 and got, "all rows")
    assert lines[0] == "x,y,w,h,confidence,state" and lines[1].endswith(",tracking"), lines[:2]
    page.find("#bag").click()
    page.wait(lambda: page.text("#replay-told") == "The bag is written.", "the bag")
    assert Path(bag).stat().st_size > 0

    # A mark on an earlier frame begins a run there.
    page.script("const s = document.getElementById('place'); s.value = 10; s.dispatchEvent(new Event('input'))")
    page.wait(lambda: page.shown()["stamp"] == "10", "the eleventh frame")
    page.scroll_to_picture()
    page.drag(scene.box(10 * PACE))
    page.wait(lambda: place()[2] == 3, "the third run")
    page.close()


if __name__ == "__main__":
    run(globals()[sys.argv[1]], *sys.argv[2:])
