"""Has the exchange of PROTOCOL.md with a daemon, and compares: exchange.py RUNTIME_DIR. Then asks for what the two cubes
have no need of: a stream that needs credit, a plan with parts gone, refusals, a plan that is not read to its end."""
import sys
import time
from collections import Counter

from client import Client, Refused, content_handle
from document import text

TRIANGLES = [[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4],
             [2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]]  # fmt: skip
NO_LIMIT = 2**64 - 1
TOWER = 40


def cube(bottom):
    return [[i & 1, i >> 1 & 1, bottom + (i >> 2)] for i in range(8)]


def request(document, handle, flags=0, **lists):
    header = {
        "handle": handle,
        "planner": document.names["PLANNERS"].index("sbdp-star"),
        "engine": document.names["ENGINES"].index("sliding"),
        "actions": document.names["ACTION_SETS"].index("extended"),
        "flags": flags,
        "max_simulations": NO_LIMIT,
        "path_timeout_ns": NO_LIMIT,
        "planning_timeout_ns": NO_LIMIT,
    }
    return document.encode("Plan", header, lists)


def shown_payloads(document):
    """The payloads of the document's exchange."""
    found = {}
    for kind, name, lines in document.exchange:
        if kind == "Payload":
            found[name] = b"".join(bytes.fromhex(line.split(maxsplit=2)[1]) for line in lines)
    return found


def without_stats(document, summary):
    """Counters and times are of the run, not of the question."""
    begin, size = next((offset, size) for offset, size, _, name in document.structs["SummaryHeader"].fields if name == "stats")
    return summary[:begin] + bytes(size) + summary[begin + size :]


def equal(what, is_, should):
    if is_ != should:
        sys.exit(f"{what} differs from PROTOCOL.md; if that is right, change ipc/tests/document/exchange.rs\n"
                 f"daemon:   {is_.hex()}\ndocument: {should.hex()}")  # fmt: skip


def as_documented(client):
    document = client.document
    shown = shown_payloads(document)
    parts = [("low", "f64 × 3", cube(0), TRIANGLES), ("high", "f32 × 3", cube(1), TRIANGLES)]
    handle = content_handle(document, "mm", parts)
    assert not client.have(handle)
    upload, answered = client.upload("cubes", "mm", parts)
    equal("the upload", upload, shown["Upload"])
    equal("the handle", answered, document.decode("Handle", shown["Handle"])["header"]["handle"])
    equal("the content handle", handle, answered)
    assert client.have(handle)

    asked = request(document, handle)
    equal("the plan request", asked, shown["Plan"])
    messages = list(client.plan(asked))
    assert [kind for kind, _ in messages] == ["Steps", "Summary"], messages
    (_, steps), (_, summary) = messages
    equal("the steps", steps, shown["Steps"])
    equal("the summary", without_stats(document, summary), without_stats(document, shown["Summary"]))

    # What they say, whatever the document shows: one cube leaves the other, from where it stands to where it is clear.
    found, end = document.decode("Steps", steps), document.decode("Summary", summary)
    names = [text(end["texts"], place) for place in end["part names"]]
    assert names == ["low", "high"] and document.names["STATUSES"][end["header"]["status"]] == "complete"
    (step,) = found["steps"]
    assert step["of"] == document.constants["NO_STEP"] and step["ends"] == document.enums["StepEnd"]["Out"]
    assert sorted(found["parts"] + end["remaining"]) == [0, 1]
    assert found["waypoints"][0] == [0, 0, 0, 1, 0, 0, 0] and max(map(abs, found["waypoints"][-1][:3])) > 1
    print(f"{names[found['parts'][0]]} leaves {names[end['remaining'][0]]} by {found['waypoints'][-1]}")


def beyond(client):
    document = client.document
    parts = [(f"cube {i}", "f64 × 3", cube(i), TRIANGLES) for i in range(TOWER)]
    _, handle = client.upload("tower", "mm", parts)
    traced = request(document, handle, document.constants["PLAN_TRACE"])
    kinds, numbers = Counter(), []
    for kind, message in client.plan(traced):
        kinds[kind] += 1
        if kind == "Steps":
            found = document.decode(kind, message)
            first = found["header"]["first_step"]
            numbers += range(first, first + len(found["steps"]))
    assert numbers == list(range(TOWER - 1)), numbers
    assert sum(kinds.values()) > document.constants["RESPONSE_BUFFER"], f"{kinds}: no credit was needed"

    gone = list(range(2, TOWER))
    messages = dict(client.plan(request(document, handle, removed=gone)))
    end = document.decode("Summary", messages["Summary"])
    assert end["removed"] == gone and end["header"]["steps"] == 1, end

    for code, payload in [
        ("UnknownHandle", request(document, bytes(32))),
        ("Malformed", request(document, handle)[:-8]),
        ("NoSuchPart", request(document, handle, removed=[TOWER])),
    ]:
        try:
            list(client.plan(payload))
        except Refused as error:
            assert error.args[0] == code, error
        else:
            sys.exit(f"a request that is {code} was answered with a plan")

    client.requests += 1
    pending = client.send(client.plan_port, "Plan", traced, request=client.requests)
    # What is let go before the daemon saw it never reaches it.
    client.receive(pending)
    pending.delete()
    client.notifier.notify()
    while True:
        numbers, version = client.status()
        if numbers["running"] + numbers["queued"] == 0:
            break
        time.sleep(0.01)
    counted = (numbers["protocol"], numbers["uploads"], numbers["requests"], numbers["refused"])
    assert counted == (document.constants["PROTOCOL"], 2, client.requests, 3), numbers
    print(f"tower: {dict(kinds)}; sbdpd {version}: {numbers['requests']} requests, {numbers['refused']} refused")


def main():
    client = Client(sys.argv[1])
    as_documented(client)
    beyond(client)


if __name__ == "__main__":
    main()
