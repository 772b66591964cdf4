"""Where the trials of a campaign run: processes of this machine, or a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from distributed import Client, LocalCluster, as_completed

from aerial_evaluation.campaign.campaign import Campaign, Trial, TrialResult
from aerial_model.errors import ConfigurationError

CONNECT_TIMEOUT = 10.0  # [s] after which there is no scheduler at an address


def results(campaign: Campaign, todo: Iterable[Trial], client: Client) -> Iterator[TrialResult]:
    """Yield the result of every trial as it comes; one whose worker died counts as not landed."""
    [shared] = client.scatter([campaign], broadcast=True)
    futures = {client.submit(Campaign.attempt, shared, trial, pure=False): trial for trial in todo}
    for future in as_completed(futures):
        if future.status == "finished":
            yield future.result()
        else:
            yield TrialResult(trial=futures[future], reason=f"the worker failed: {future.exception()!r}")
        future.release()


@contextmanager
def workers(number: int, scheduler: str | None = None) -> Iterator[Client]:
    """Yield a client of ``number`` worker processes on this machine, or of the cluster at an address.

    Raises:
        ConfigurationError: if there is no scheduler at the address.
    """
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=CONNECT_TIMEOUT)
        except (OSError, ValueError) as error:
            raise ConfigurationError(f"no Dask scheduler answers at '{scheduler}' ({error})") from None
        with client:
            yield client
        return
    cluster = LocalCluster(n_workers=number, threads_per_worker=1, dashboard_address=None, silence_logs="ERROR")
    with cluster, Client(cluster) as client:
        yield client
