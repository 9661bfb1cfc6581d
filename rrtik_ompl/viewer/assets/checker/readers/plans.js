// Plans of tasks of rrtik-ompl, in JSON: the parts that a certificate of the task has.

/** Parts {scene, waypoints, begin, held, base, padding, tip} of a plan: its motions, divided where contacts end. */
function partsOfPlan(plan, file, lookup) {
  return listOf(plan.motions, file).flatMap((motion, k) => {
    const where = `${file}: motion ${k + 1}`;
    const settings = Object.fromEntries(SETTING_KEYS.filter((key) => Object.hasOwn(plan, key)).map((key) => [key, plan[key]]));
    const whole = sceneWithFiles(sceneOf({ version: 1, scene: motion.scene ?? {}, ...settings, path_constraints: motion.stage?.path_constraints ?? [] }, where), file, lookup);
    const contacts = listOf(motion.contacts, where).map((each) => ({ pair: namePair(each.pair, where), distance: finite(each.distance, where), until: each.until ?? null, then: each.then ?? null }));
    const last = motion.waypoints.length - 1;
    const partings = [...new Set(contacts.map((each) => each.until))].filter((until) => until !== null && until > 0 && until < last);
    const cuts = [0, ...partings.sort((a, b) => a - b), last];
    const stance = { ...stanceOf(motion.robot ?? null, where), padding: paddingOf(motion.robot ?? null), begin: motion.waypoints[0] };
    return cuts.slice(0, -1).map((first, n) => {
      const known = (pair) => contacts.some((each) => [...each.pair].sort().join("|") === [...pair].sort().join("|"));
      const left = contacts.flatMap(({ pair, distance, until, then }) => {
        if (until === null || until > first) return [{ pair, distance }];
        return then === null ? [] : [{ pair, distance: then }];
      });
      const scene = { ...whole, contacts: [...whole.contacts.filter(({ pair }) => !known(pair)), ...left] };
      return { scene, waypoints: motion.waypoints.slice(first, cuts[n + 1] + 1), ...stance };
    });
  });
}
