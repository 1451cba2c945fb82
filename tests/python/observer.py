"""A participant of another vendor that is up before several agents start at once: does it discover all of them?

Prints {"ready": true}. Each line of its input lists the modules that start then, such as [1, 2]; it answers with `seconds`, how
long it took until every node, service and endpoint of them was known, and `missing`, what was not after the limit.

Usage: observer.py (fast | cyclone) DOMAIN LIMIT_S
"""

import json
import sys
import time

NAMESPACE = "/formation"
SERVICES = ("add_module", "retire_module", "get_parameters", "list_parameters", "set_parameters", "describe_parameters",
            "get_parameter_types", "set_parameters_atomically")
SUBSCRIBED = ("target", "claims", "roster", "heartbeats", "module_states", "commands")
PUBLISHED = ("claims", "heartbeats", "module_states")


class Fast:
    """rclpy, which also knows nodes."""

    def __init__(self, _domain):
        import rclpy

        rclpy.init()
        self.node = rclpy.create_node("observer")

    def names_of(self, module):
        try:
            found = self.node.get_service_names_and_types_by_node(f"module_{module}", NAMESPACE)
        except RuntimeError:
            return None
        return {name for name, _ in found}

    def missing(self, modules):
        missing = []
        for module in modules:
            names = self.names_of(module)
            if names is None:
                missing.append(f"node of module {module}")
                continue
            services = (f"{NAMESPACE}/module_{module}/{service}" for service in SERVICES)
            missing += [service for service in services if service not in names]
        for kind, topics, count in (
            ("subscription", SUBSCRIBED, self.node.count_subscribers),
            ("publisher", PUBLISHED, self.node.count_publishers),
        ):
            found = {topic: count(f"{NAMESPACE}/{topic}") for topic in topics}
            missing += [f"{kind} of {topic}: {n} of {len(modules)}" for topic, n in found.items() if n < len(modules)]
        return missing


class Cyclone:
    """CycloneDDS, which knows endpoints alone."""

    def __init__(self, domain):
        import formation_dds
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription

        self.participant = formation_dds.DomainParticipant(domain)
        self.readers = {
            "publisher": BuiltinDataReader(self.participant, BuiltinTopicDcpsPublication),
            "subscription": BuiltinDataReader(self.participant, BuiltinTopicDcpsSubscription),
        }

    def names(self, kind):
        """The topics of the endpoints that live, once for each."""
        return [sample.topic_name for sample in self.readers[kind].read(10_000) if sample.sample_info.valid_data]

    def missing(self, modules):
        names = {kind: self.names(kind) for kind in self.readers}
        expected = [("publisher", f"rt{NAMESPACE}/{topic}", len(modules)) for topic in PUBLISHED]
        expected += [("subscription", f"rt{NAMESPACE}/{topic}", len(modules)) for topic in SUBSCRIBED]
        requests = (f"rq{NAMESPACE}/module_{module}/{service}Request" for module in modules for service in SERVICES)
        expected += [("subscription", request, 1) for request in requests]
        counted = [(kind, name, names[kind].count(name), least) for kind, name, least in expected]
        return [f"{kind} of {name}: {found} of {least}" for kind, name, found, least in counted if found < least]


def main():
    vendor, domain, limit_s = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
    observer = {"fast": Fast, "cyclone": Cyclone}[vendor](domain)
    print(json.dumps({"ready": True}), flush=True)
    for line in sys.stdin:
        modules = json.loads(line)
        since = time.monotonic()
        while (missing := observer.missing(modules)) and time.monotonic() - since < limit_s:
            time.sleep(0.05)
        print(json.dumps({"seconds": round(time.monotonic() - since, 2), "missing": missing}), flush=True)


main()
