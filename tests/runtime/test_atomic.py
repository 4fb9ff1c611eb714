import pytest

from ridgebayes.runtime.atomic import replacing


def test_replacing__keeps_the_old_file_and_no_other_where_writing_fails(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("before")

    def fail():
        with replacing(path) as partial:
            partial.write_text("half")
            assert partial.parent == path.parent
            raise OSError

    with pytest.raises(OSError):
        fail()
    assert [(found.name, found.read_text()) for found in tmp_path.iterdir()] == [
        ("table.csv", "before")
    ]


def test_replacing__puts_the_new_file_in_place_of_the_old(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("before")
    with replacing(path) as partial:
        partial.write_text("after")
        assert path.read_text() == "before"
    assert [found.read_text() for found in tmp_path.iterdir()] == ["after"]
