from typing import NamedTuple

from studies.resumed import resumed


class Task(NamedTuple):
    name: str
    index: int


def test_resumed__computes_only_what_the_file_does_not_hold(tmp_path):
    path, seen = tmp_path / "new" / "done.jsonl", []

    def computed(task):
        seen.append(task)
        return {"name": task.name, "index": task.index, "value": 2 * task.index}

    first = [Task("a", 1), Task("b", 1)]
    assert resumed(path, first, Task._fields, computed)["value"].tolist() == [2, 2]
    found = resumed(path, [*first, Task("a", 2)], Task._fields, computed)
    assert seen == [*first, Task("a", 2)]
    assert found["value"].tolist() == [2, 2, 4]
    assert len(path.read_text().splitlines()) == 3
    assert resumed(path, [], Task._fields, computed).equals(found)
