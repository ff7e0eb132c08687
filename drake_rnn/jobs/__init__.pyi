"""Names of jobs, and the modules that they are lent from when they are first used."""

from .campaign import CampaignResult as CampaignResult, run_campaign as run_campaign, sweep as sweep
from .campaign import run_each as run_each, simulate_each as simulate_each
from .plan import (
    CampaignDocument as CampaignDocument,
    Plan as Plan,
    plan_campaign as plan_campaign,
    plan_sweep as plan_sweep,
    read_campaign as read_campaign,
    shipped_campaigns as shipped_campaigns,
)
from .pool import cluster_at as cluster_at, workers_of as workers_of
from .requests import RunRecord as RunRecord, RunRequest as RunRequest
