"""Many runs of one experiment: campaigns, and sweeps on the same engine."""

from .campaign import CampaignResult, kept_rows, run_campaign
from .cluster import cluster_at, workers_of
from .document import CampaignDocument, read_campaign, shipped_campaigns
from .outcome import Order, Outcome
from .perform import simulate_each
from .plan import Plan, plan_campaign
from .side_by_side import run_each

__all__ = [
    "CampaignDocument",
    "CampaignResult",
    "Order",
    "Outcome",
    "Plan",
    "cluster_at",
    "kept_rows",
    "plan_campaign",
    "read_campaign",
    "run_campaign",
    "run_each",
    "shipped_campaigns",
    "simulate_each",
    "workers_of",
]
