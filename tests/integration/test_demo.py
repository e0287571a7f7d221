from service.demo import main


def test_a_demo_that_cannot_be_posted_says_so_and_leaves_no_service(tmp_path, capsys):
    arguments = ["--family", "highway", "--out", str(tmp_path / "demo.json"), "--data-dir", str(tmp_path / "data")]
    assert main(arguments) == 1
    assert "families[0]: Input should be 'low', 'mixed' or 'dense'" in capsys.readouterr().out.replace("\n", "")
    assert not (tmp_path / "demo.json").exists()
    assert "Finished server process" in (tmp_path / "data" / "service.log").read_text()
