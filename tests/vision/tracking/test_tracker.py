from __future__ import annotations

from tests.support.landing import SMALL, TAG


def test_an_id_that_tags_does_not_name_has_the_size_of_the_main_tag_of_now(lockstep):
    rig = lockstep(sim_tags=TAG, **SMALL)
    rig.run(rig.tracker.add_tag_id(5))
    assert rig.tracker.options(rig.tracker.settings).sizes == {0: 0.3, 5: 0.3}
    rig.put(tags="0:0.6")
    assert rig.tracker.options(rig.tracker.settings).sizes == {0: 0.6, 5: 0.6}
