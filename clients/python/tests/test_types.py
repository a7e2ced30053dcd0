"""The generated types are current, and the public names have the types that they promise."""

import inspect

import fretwork_client
import generate_types


def test_the_types_are_those_of_the_contract() -> None:
    assert generate_types.TARGET.read_text(encoding="utf-8") == generate_types.generated()


def test_a_method_shows_its_arguments_and_its_result() -> None:
    signature = inspect.signature(fretwork_client.Client.run)
    assert list(signature.parameters) == ["self", "scenario", "label", "tags"]
    assert signature.return_annotation == "Run"
