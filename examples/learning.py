"""For learning: environments of Gymnasium, experts, and what they have shown. Needs pip install 'rrtik-ompl[gym]'."""

import gymnasium
import numpy as np

import rrtik_ompl as rrtik
import rrtik_ompl.gym

posts = [rrtik.Obstacle(f"post {k}", rrtik.Cylinder(0.03, 1.0), [np.cos(k) / 2, np.sin(k) / 2, 0.3]) for k in range(5)]
world = rrtik.World(rrtik.load_robot("ur5"), rrtik.Scene(posts))
for env in (gymnasium.make("rrtik/Reach-v0", world=world, increment=0.2), gymnasium.make("rrtik/PickPlace-v0")):
    for seed in range(2):
        observation, info = env.reset(seed=seed)
        shown = []
        total = 0.0
        for action in rrtik_ompl.gym.expert(env):
            shown.append((observation, action))
            observation, reward, ended, cut, info = env.step(action)
            total += float(reward)
        print(f"{env}, episode {seed}: {len(shown)} steps, reward {total:.2f}, {info}")
