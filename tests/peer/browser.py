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
PASSED = 0.6
# Seconds that a mark is late.
LATE = 0.5


class Camera(threading.Thread):
    """A peer that sends images at their rate, and listens, on a thread of its own."""

    def __init__(self):
        super().__init__(daemon=True)
        self.peer = Peer()
        self.peer.scene = Scene(*SIZE, TARGET)
        self.said = {}
        # Whether the target is behind something, and whether this is to end.
        self.hides = False
        self.ends = False
        self.start()

    def run(self):
        peer, due, index = self.peer, time.monotonic(), 0
        while not self.ends:
            index += 1
            picture = peer.scene.background if self.hides else peer.scene.rgb(index * PACE)
            peer.images.publish(image_message(picture, "rgb8", index))
            due = max(due + 1 / RATE, time.monotonic() - 1)
            while (left := due - time.monotonic()) > 0 and not self.ends:
                peer.executor.spin_once(timeout_sec=left)
            for message in peer.tracks:
                self.said[nanos(message)] = message
            peer.tracks.clear()

    def box(self, stamp):
        """Where the target is on the image of this stamp."""
        return self.peer.scene.box(index_of(stamp) * PACE)

    def newest(self):
        return self.said[max(self.said)] if self.said else None

    def followed(self):
        """The first message that tells of a target."""
        return next((self.said[stamp] for stamp in sorted(self.said) if self.said[stamp].tracks), None)

    def near(self):
        """Whether the newest message has the target where it is."""
        said = self.newest()
        return said.tracks and iou(box_of(said.tracks[0]), self.box(nanos(said))) > HELD

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


def index_of(stamp):
    return round((int(stamp) - 1_000_000_000_000) / 33_333_333)


def near(a, b, what):
    assert max(abs(p - q) for p, q in zip(a, b)) <= NEAR, f"{what}: {a} and {b}"


def live(page):
    """A target is marked late, watched, tuned and stopped on the page."""
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
    lose_and_find(page, camera)
    mark_anew_by_finger(page, camera)
    camera.ends = True
    camera.join()


def mark_late(page, camera):
    """A mark that is dragged half a second after its frame came lands on that frame, while the target moves on."""

    def goes_on(stamp):
        """The target will be elsewhere by the time of the mark."""
        return iou(camera.box(stamp), camera.peer.scene.box((index_of(stamp) + LATE * RATE) * PACE)) < PASSED

    page.wait(lambda: goes_on(page.shown()["stamp"]), "the target moves fast")
    page.find("#freeze").click()
    frozen = page.shown()["stamp"]
    time.sleep(LATE)
    assert page.shown()["stamp"] == frozen, "the picture stands still"
    box = camera.box(frozen)
    page.drag(box)
    first = page.wait(camera.followed, "the target is followed")
    assert page.shown()["stamp"] == frozen
    page.wait(lambda: "marked" in page.text("#events"), "the event of the mark")
    page.find("#freeze").click()
    passed, there = index_of(nanos(first)) - index_of(frozen), camera.box(nanos(first))
    landed, drawn = iou(box_of(first.tracks[0]), there), iou(box, there)
    print(f"marked {passed} frames late: overlap on the newest frame {landed:.2f}, of the box as drawn {drawn:.2f}")
    assert passed >= LATE * RATE and landed > LANDED and drawn < PASSED, (passed, landed, drawn)


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
    page.fill(field, "65535")
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
    page.fill(page.find("#targets .picked form input"), "the walker")
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


def mark(page, camera, draw):
    """Draws a box around the target as it is on a frozen picture."""
    page.find("#freeze").click()
    draw(camera.box(page.shown()["stamp"]))
    page.find("#freeze").click()
    page.wait(camera.near, "the target is followed where it is")


def lose_and_find(page, camera):
    """A target that is lost, and found again, is an event with a picture of that moment."""
    state = lambda: camera.newest().tracks and camera.newest().tracks[0].state
    page.script("document.getElementById('events').replaceChildren()")
    mark(page, camera, page.drag)
    camera.hides = True
    page.wait(lambda: state() == Track.LOST, "the target is lost")
    lost = page.wait(lambda: page.moment("lost"), "the event and its picture")
    camera.hides = False
    page.wait(lambda: state() == Track.TRACKING, "the target is found again")
    found = page.wait(lambda: page.moment("found"), "the event and its picture")
    page.wait(camera.near, "the target is where it is said to be")
    print(f"brightness around the target: {lost:.0f} where it is lost, {found:.0f} where it is found again")
    assert found > lost + 30, "the target is in the one picture and not in the other"
    page.script("document.getElementById('events').scrollIntoView({block: 'center'})")
    page.picture("lost-and-found")


def mark_anew_by_finger(page, camera):
    """On a phone: a tap picks the target, and a box that a finger draws is that target from then on."""
    page.size("phone")
    page.scroll_to_picture()

    def pick():
        left, top, width, height = next(iter(page.shown()["boxes"].values()))
        page.finger((left + width / 2, top + height / 2))
        return page.script("return document.querySelector('#targets .picked')?.dataset.id ?? null")

    picked = page.wait(pick, "the target is picked")
    before = camera.newest().tracks[0]
    assert picked == before.id
    page.find("#targets .picked .anew").click()
    page.wait(lambda: picked in page.text("#mode"), "the page says what the box is for")
    page.scroll_to_picture()
    mark(page, camera, page.touch)
    is_anew = lambda: (t := camera.newest().tracks) and t[0].age < before.age and t[0]
    anew = page.wait(is_anew, "the target is marked anew")
    assert anew.id == picked and len(camera.newest().tracks) == 1, (picked, camera.newest().tracks)
    page.picture("phone-picked")
    page.size("desktop")


def frames(folder, count):
    """Writes the scene's images as files."""
    scene = Scene(*SIZE, TARGET)
    for index in range(int(count)):
        height, width, _ = (rgb := scene.rgb(index * PACE)).shape
        header = f"P6 {width} {height} 255\n".encode()
        (Path(folder) / f"{index:04}.ppm").write_bytes(header + rgb.tobytes())


def recording(page, bag):
    """A target is marked in a recording, which is played, gone back in, run again with another parameter, and saved."""
    scene = Scene(*SIZE, TARGET)
    folder = str(page.pictures)
    page.driver.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": folder})
    numbers = "return [...document.getElementById('frames').innerText.matchAll(/[0-9]+/g)].map(Number)"
    place = lambda: page.script(numbers)
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
    page.fill(field, "0.05")
    field_of = "[data-name='lcmht.filter.learning_rate']"
    page.wait(lambda: "is-changed" in page.find(field_of).get_attribute("class"), "the parameter is changed")
    page.find("#again").click()
    page.wait(lambda: place()[2] == 2 and place()[0] == place()[1], "the second run ends")
    page.picture("run-again")
    page.find("#rows").click()
    rows = page.pictures / "tracks.csv"
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


def browse(scenario, link, pictures, *arguments):
    """Does that on the page in a browser, which ends with it."""
    with Page(link, pictures) as page:
        globals()[scenario](page, *arguments)


if __name__ == "__main__":
    name, *arguments = sys.argv[1:]
    run(frames, *arguments) if name == "frames" else run(browse, name, *arguments)
