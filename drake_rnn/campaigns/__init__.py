"""Many runs of one experiment: campaigns, and sweeps on the same engine."""

from .campaign import (
    CampaignResult as CampaignResult,
    kept_rows as kept_rows,
    run_campaign as run_campaign,
)
from .workers import (
    cluster_at as cluster_at,
    workers_of as workers_of,
)
from .document import (
    CampaignDocument as CampaignDocument,
    read_campaign as read_campaign,
    shipped_campaigns as shipped_campaigns,
)
from .requests import (
    Order as Order,
    Outcome as Outcome,
)
from .requests import simulate_each as simulate_each
from .plan import Plan as Plan, plan_campaign as plan_campaign
from .plan import run_each as run_each
