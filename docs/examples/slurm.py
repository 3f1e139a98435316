"""Run an experiment on workers that Slurm starts, by dask-jobqueue: one worker process a core, restarted elsewhere."""

from __future__ import annotations

import argparse

import nlbench as nb


def main() -> None:
    """Ask for the workers, run, give them back."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("config")
    parser.add_argument("--out", default="results")
    parser.add_argument("--workers", type=int, default=16, help="worker processes in all")
    parser.add_argument("--cores", type=int, default=8, help="cores, and worker processes, of a job")
    parser.add_argument("--memory", default="16GB", help="memory of a job")
    parser.add_argument("--queue", help="partition")
    parser.add_argument("--account")
    parser.add_argument("--walltime", default="01:00:00")
    chosen = parser.parse_args()

    from dask_jobqueue import SLURMCluster

    cluster = SLURMCluster(
        cores=chosen.cores,
        processes=chosen.cores,
        memory=chosen.memory,
        queue=chosen.queue,
        account=chosen.account,
        walltime=chosen.walltime,
    )
    with cluster:
        cluster.scale(n=chosen.workers)
        cluster.wait_for_workers(1)  # the queue may be long; the others are taken as they come
        print(nb.run(chosen.config, chosen.out, dask=cluster.scheduler_address).path)


if __name__ == "__main__":
    main()
