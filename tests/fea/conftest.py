"""Import of tables from their content."""

import pytest

import ridgebayes as rb
from tests.fea.tables import imported


@pytest.fixture
def read(tmp_path, request):
    """Import a table from its content; a module names the file by `FILE_NAME`."""
    usual = getattr(request.module, "FILE_NAME", "mine.csv")

    def read_text(text, mapping=None, name=usual, **facts):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return imported(path, mapping, **facts)

    return read_text


@pytest.fixture
def refusal(read):
    """Return the message with which a table is refused."""

    def words(*args, **facts):
        with pytest.raises(rb.InputError) as caught:
            read(*args, **facts)
        text = str(caught.value)
        assert "mine." in text
        assert "\n\n" not in text
        words.error = caught.value
        return text

    return words
