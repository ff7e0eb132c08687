"""What the laws that tests make up see: where the end effector is, and where it should be."""

from drake_rnn import Layout


class SeesTask:
    """A law whose state is a velocity of the joints. Its limits are a field of the law itself."""

    @property
    def state(self):
        return Layout(v=(self.limits.size,))

    @property
    def inputs(self):
        return Layout(p_WE=(3,), p_WE_desired=(3,), J=(3, self.limits.size))
