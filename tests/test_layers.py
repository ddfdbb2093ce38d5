from importlinter.cli import lint_imports


def test_arrows_point_from_reports_to_tasks(capsys):
    assert lint_imports() == 0, capsys.readouterr().out
