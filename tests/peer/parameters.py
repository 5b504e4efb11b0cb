"""The node's parameters, as rclpy's own client sees them; part of `scenarios.py`."""

import itertools
import os
import tempfile
from collections import deque

from peer import *  # noqa: F403
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterType, ParameterValue
from rclpy.parameter import parameter_dict_from_yaml_file, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

# How many times as long a frame may take while parameters are set.
MOST_SLOWER = 2.5


def boolean(name, value):
    return Parameter(name=name, value=ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=value))


def integer(name, value):
    return Parameter(name=name, value=ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=value))


def double(name, value):
    return Parameter(name=name, value=ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value))


def text(name, value):
    return Parameter(name=name, value=ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=value))


class Client:
    """rclpy's AsyncParameterClient, each answer of which is waited for."""

    def __init__(self, peer, node="/tracker"):
        self.peer = peer
        self.ros = AsyncParameterClient(peer.node, node)
        peer.spin_until(self.ros.services_are_ready, "the parameter services")

    def __getattr__(self, name):
        def call(*args, **options):
            future = getattr(self.ros, name)(*args, **options)
            self.peer.spin_until(future.done, f"the answer of {name}")
            return future.result()

        return call

    def get(self, *names):
        return [parameter_value_to_python(v) for v in self.get_parameters(list(names)).values]

    def set(self, *parameters):
        return self.set_parameters(list(parameters)).results


def parameters(default_file):
    """The six services against the one table and the file of its defaults."""
    peer = Peer()
    events = peer.listen(ParameterEvent, "/parameter_events", QoSProfile(depth=1000))
    changes = lambda: [[p.name for p in e.changed_parameters] for e in events if e.node == "/tracker"]
    client = Client(peer)
    # The first event may be too early for the node to have found this listener.
    for value in itertools.cycle([True, False]):
        client.set(boolean("use_sim_time", value))
        if not value and changes():
            break
    events.clear()

    defaults = parameter_dict_from_yaml_file(default_file, use_wildcard=True)
    defaults = {name: parameter_value_to_python(p.value) for name, p in defaults.items()}
    qos = [f"qos_overrides./image.subscription.{p}" for p in ("depth", "durability", "history", "reliability")]
    names = every_name(client, sorted([*defaults, "use_sim_time", *qos]))
    descriptors(client, names)
    for name, value in zip(names, client.get(*names)):
        assert name not in defaults or value == defaults[name], (name, value, defaults[name])
    assert client.get("nonsense", "seed") == [None, 0]

    refusals(client)
    assert changes() == [], changes()
    assert [r.successful for r in client.set(integer("debug.max_side", 100), boolean("use_sim_time", True))] == [True] * 2
    both = [integer("debug.max_side", 50), integer("debug.jpeg_quality", 60)]
    assert client.set_parameters_atomically(both).result.successful
    assert client.get("debug.max_side", "debug.jpeg_quality", "use_sim_time") == [50, 60, True]
    told = [["debug.max_side"], ["use_sim_time"], ["debug.max_side", "debug.jpeg_quality"]]
    peer.spin_until(lambda: changes() == told, "the events of the changes")
    assert not client.list_parameters(["nonsense"]).result.names

    # What is there already, fixed parameters included, is no change; what is not, is.
    assert all(r.successful for r in client.load_parameter_file(default_file, use_wildcard=True).results)
    assert client.get("debug.max_side", "debug.jpeg_quality") == [208, 80]
    own_file(client)
    peer.close()


def every_name(client, expected):
    """All names are listed, and those below a prefix or above a depth."""
    listed = client.list_parameters().result
    assert sorted(listed.names) == expected, set(listed.names) ^ set(expected)
    # Those that are met first in front, those for ablation last.
    assert listed.names[0] == "algorithm" and listed.names.index("lcmht.filter.kind") > listed.names.index("use_sim_time")
    assert {"debug", "lcmht.svm"} <= set(listed.prefixes), listed.prefixes
    assert client.list_parameters(["debug"]).result.names == ["debug.max_side", "debug.compressed_max_side", "debug.jpeg_quality"]
    assert all("." not in n for n in client.list_parameters(depth=1).result.names)
    return listed.names


def descriptors(client, names):
    """Each parameter is described, all in one answer."""
    described = client.describe_parameters(names).descriptors
    assert [d.name for d in described] == names
    types = list(client.get_parameter_types([*names, "nonsense"]).types)
    assert types == [d.type for d in described] + [0]
    for d in described:
        assert d.description and d.type and not d.dynamic_typing, d
        assert len(d.integer_range) == (d.type == ParameterType.PARAMETER_INTEGER), d
        assert len(d.floating_point_range) == (d.type == ParameterType.PARAMETER_DOUBLE), d
        assert all(r.step == 0 and r.from_value < r.to_value for r in [*d.integer_range, *d.floating_point_range]), d
    known = {d.name: d for d in described}
    side = known["debug.max_side"].integer_range[0]
    assert (side.from_value, side.to_value) == (16, 4096)
    fixed = {name for name, d in known.items() if d.read_only}
    assert {"seed", "algorithm", "qos_overrides./image.subscription.depth"} <= fixed, fixed
    assert not {"debug.max_side", "use_sim_time", "lcmht.svm.opinion"} & fixed, fixed
    assert "lcmht" in known["algorithm"].additional_constraints


def refusals(client):
    """What is refused changes nothing, and says why."""
    side = "debug.max_side"
    for parameter, why in [
        (integer("debug.max_sid", 100), f"did you mean '{side}'?"),
        (text(side, "large"), 'got string "large"'),
        (integer(side, 5), "16 to 4096, got 5"),
        (integer("seed", 5), "read-only"),
        (text("qos_overrides./image.subscription.reliability", "reliable"), "read-only"),
        (integer("use_sim_time", 1), "of type bool"),
        (Parameter(name=side), "no value"),
    ]:
        (result,) = client.set(parameter)
        assert not result.successful and why in result.reason, result
    (result,) = client.delete_parameters([side]).results
    assert not result.successful, "what is declared cannot be undeclared"
    for bad in integer("debug.jpeg_quality", 101), Parameter(name="debug.jpeg_quality"):
        result = client.set_parameters_atomically([integer(side, 50), bad]).result
        assert not result.successful and "debug.jpeg_quality" in result.reason, result
    for name in "lcmht.cnn.file", "lcmht.cnn.library":
        result = client.set_parameters_atomically([integer(side, 50), text(name, "/dev/zero")]).result
        assert not result.successful and f"'{name}' is read-only" in result.reason, result
    assert client.get(side, "debug.jpeg_quality") == [208, 80], "all or nothing"


def own_file(client):
    """A parameter file for this node, taken one by one or as a whole."""
    with tempfile.TemporaryDirectory() as folder:
        file = os.path.join(folder, "own.yaml")

        def write(quality):
            with open(file, "w") as out:
                print(f"/tracker: {{ros__parameters: {{debug: {{max_side: 77, jpeg_quality: {quality}}}}}}}", file=out)

        write(1000)
        assert not client.load_parameter_file_atomically(file).result.successful
        assert client.get("debug.max_side") == [208]
        assert [r.successful for r in client.load_parameter_file(file).results] == [True, False]
        write(33)
        assert client.load_parameter_file_atomically(file).result.successful
        assert client.get("debug.max_side", "debug.jpeg_quality") == [77, 33]


def overridden():
    """The quality of service of the image subscription as the start-up parameters say."""
    peer = Peer(image_qos=QoSProfile(depth=5, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    # Published before the node is matched: only a transient local reader hears of it.
    peer.images.publish(peer.message(0))
    peer.spin_until(lambda: peer.tracks, "tracks of an early image")
    (reader,) = peer.node.get_subscriptions_info_by_topic("/image")
    assert reader.qos_profile.reliability == ReliabilityPolicy.RELIABLE, reader.qos_profile
    assert reader.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL, reader.qos_profile
    names = [f"qos_overrides./image.subscription.{p}" for p in ("depth", "durability", "history", "reliability")]
    assert Client(peer).get(*names) == [3, "transient_local", "keep_last", "reliable"]
    peer.close()


class Sets:
    """Pairs of values set as one while a target is followed."""

    NAMES = ["lcmht.confidence.activate", "lcmht.confidence.reacquire"]
    # Half of one and half of another is neither.
    PAIRS = [(0.45, 0.55), (0.5, 0.6)]
    A_FRAME, MOST_WAITING = 10, 4
    # Odd, so that now one pair is met and now the other.
    A_LOOK = 7

    def __init__(self, peer):
        self.peer = peer
        self.client = Client(peer).ros
        self.requests = itertools.cycle([[double(n, v) for n, v in zip(self.NAMES, pair)] for pair in self.PAIRS])

    def run(self, count, least_frames=0):
        """Sends frames, each once the last is answered, until there are as many and `count` sets are answered. Gives the
        answers, the values as they were read in between, the number of frames, and the node's own median time for one."""
        peer, client = self.peer, self.client
        answers, waiting, values, times = [], deque(), [], []
        asked, began = 0, time.monotonic()

        def ask():
            nonlocal asked
            while waiting and waiting[0].done():
                answers.append(waiting.popleft().result().result)
            while asked < min(count, self.A_FRAME * (len(times) + 1)) and len(waiting) < self.MOST_WAITING:
                waiting.append(client.set_parameters_atomically(next(self.requests)))
                asked += 1
                if asked % self.A_LOOK == 0:
                    values.append(client.get_parameters(self.NAMES))

        while len(answers) < count or len(times) < least_frames:
            peer.index += 1
            said = peer.send(peer.message(peer.index), ask)
            assert len(said.tracks) == 1 and said.skipped == 0, said
            times.append(said.processing_time.sec + said.processing_time.nanosec * 1e-9)
        peer.spin_until(lambda: all(v.done() for v in values), "the answers with values")
        values = [tuple(v.double_value for v in future.result().values) for future in values]
        print(f"{len(answers)} sets in {time.monotonic() - began:.1f} s, {len(times)} frames of {np.median(times) * 1e3:.1f} ms")
        return answers, values, len(times), float(np.median(times))


def many_sets(count):
    """So many sets are all answered, none is seen by halves, and no frame is lost by them or takes much longer."""
    count = int(count)
    peer = Peer()
    events = peer.listen(ParameterEvent, "/parameter_events", QoSProfile(depth=10 * count))
    changed = lambda: [[p.name for p in e.changed_parameters] for e in events if e.node == "/tracker"]
    sets = Sets(peer)
    peer.connect()
    peer.start()
    peer.follow(3)
    for _ in range(5):
        events.clear()
        answers, values, frames, took = sets.run(count)
        assert all(a.successful for a in answers), next(a.reason for a in answers if not a.successful)
        assert set(values) == set(sets.PAIRS), f"torn: {set(values)}"
        peer.spin_until(lambda: len(changed()) == count, "an event for each set")
        assert all(names == sets.NAMES for names in changed()), "torn"
        # Both sides of a set need the processor, and others may; what frames take without sets is looked at beside.
        *_, alone = sets.run(0, frames)
        if took < MOST_SLOWER * alone:
            break
    else:
        raise AssertionError("each time frames take much longer with sets than without")
    peer.follow(3)
    peer.close()
