"""An episode that crashes its worker again and again, in the service."""


def test_it_is_recorded_as_rejected_and_the_run_goes_on(serve):
    service = serve("crashing_worker", lease_s=30)
    campaign = service.wait(service.post(methods=["random"], budget={"episodes": 5}))
    (run,) = campaign["runs"]
    assert (run["state"], run["attempts"], run["episodes_done"], run["rejected"]) == ("succeeded", 3, 5, 1)
    episodes = service.get(campaign["id"], "/episodes")["items"]
    assert [(item["index"], item["reason"]) for item in episodes if item["outcome"] == "rejected"] == [(2, "sim_crash")]
    metrics = service.client.get("/metrics").text
    assert 'risk_sac_worker_restarts_total{cause="crashed"} 2.0' in metrics
