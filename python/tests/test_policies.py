"""Policies of one's own."""

import formation
import pytest


def hungarian(instance):
    """The plan of another policy, as an allocation."""

    def placed(key):
        return [{name: one[name] for name in ("id", "x", "y", "theta")} for one in instance[key]]

    scenario = formation.Scenario.from_dict(
        {
            "target": {"spots": placed("spots"), "edges": instance["edges"]},
            "singletons": placed("modules"),
        }
    )
    return formation.plan(scenario, policy="hungarian").assignments


@pytest.mark.parametrize("seed", range(20))
def test_what_a_function_decides_is_planned_and_can_be_carried_out(seed):
    scenario = formation.Scenario.generate(14, 14 - seed % 4, seed=seed)
    plan = formation.plan(scenario, policy=hungarian)
    assert plan.assignments == hungarian(formation.instance(scenario))
    reference = formation.plan(scenario, policy="hungarian")
    assert plan.total_distance == reference.total_distance and plan.makespan == reference.makespan
    assert formation.verify(scenario, plan.trace()).outcome == "COMPLETE"


def test_an_instance_says_what_is_docked():
    instance = formation.instance(formation.Scenario.from_map("o-o-o", "A-A   s"))
    assert [module["links"] for module in instance["modules"]] == [[2], [1], []]
    assert [module["configuration"] for module in instance["modules"]] == [1, 1, None]
    assert all(module["reachable"] for module in instance["modules"])
    assert instance["edges"] == [[1, 2], [2, 3]] and instance["utilities"].shape == (3, 3)


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ({1: 1, 2: 2, 9: 3}, "^allocation: module 9 takes no part"),
        ({1: 1, 2: 2, 3: 9}, "spot 9"),
        ({1: 1, 2: 1, 3: 3}, "spot 1 is given twice: module 1 has it"),
        ({1: 1, 2: 2}, "module 3 is missing"),
        (None, "must return"),
        ({1: 1.5}, "must return"),
        ({"a": 1}, "must return"),
        ({1: -1}, "must return"),
    ],
)
def test_what_is_no_allocation_is_refused(answer, words):
    scenario = formation.Scenario.from_map("o-o-o", "A-A   s")
    with pytest.raises(formation.PlanError, match=words):
        formation.plan(scenario, policy=lambda instance: answer)


def test_an_error_of_the_function_passes_through():
    with pytest.raises(ZeroDivisionError):
        formation.plan(formation.Scenario.from_map("o", "s"), policy=lambda instance: 1 / 0)


def test_an_unknown_policy_is_named():
    with pytest.raises(formation.ScenarioError, match="magic") as caught:
        formation.plan(formation.Scenario.from_map("o", "s"), policy="magic")
    assert caught.value.field == "planner.policy"
