// What tests and pictures ask of a page, by the parts that it gives the console (templates/view/page/controls.js).
(() => {
  const parts = window.cutjoint;
  if (!parts) return;
  const { setTime, place, nodes, camera, state } = parts, { drive } = parts;
  window.cutjoint = {
    setTime, choose: parts.choose, play: parts.play, motion: parts.chooseMotion, tab: parts.showTab, select: parts.select, table: parts.tableText,
    /** The pixel of a body's centre of mass at a time, s; of a page with a host or a drive, now. */
    project(body, time) {
      if (!parts.about.live && !parts.about.drive) setTime(time);
      camera.updateMatrixWorld();
      return place(nodes.get(body)).slice(0, 2);
    },
    /** The pixel of the mark around the failed element. */
    mark() { camera.updateMatrixWorld(); return place(parts.marks[0]).slice(0, 2); },
    /** The pixel of a body's ghost. */
    ghost(body, time) {
      setTime(time);
      parts.scene.updateMatrixWorld();
      let found;
      parts.ghost.scene.traverse((object) => { if (object.userData.body === body) found = object; });
      return place(found).slice(0, 2);
    },
    /** Both ends of an arrow, in the scene's axes (y is up). */
    arrow(name, time) {
      setTime(time);
      const node = parts.arrows.find((a) => a.userData.arrow === name), at = node.localToWorld(new parts.Vector3());
      const along = node.localToWorld(new parts.Vector3(0, 0, 1)).sub(at).normalize();
      return { at: at.toArray(), along: along.toArray(), newton: node.scale.x * node.userData.newton };
    },
    /** Position and target of the camera in the scene's axes (y is up), its field of view in degrees, and the picture's size in pixels. */
    eye() {
      const { clientWidth, clientHeight } = parts.picture;
      return { from: camera.position.toArray(), to: parts.orbit.target.toArray(), angle: camera.fov, size: [clientWidth, clientHeight] };
    },
    plotted() { return parts.plot?.data; },
    /** The points of a body's trace, in the scene's axes. */
    path(body) { return parts.pathOf(body).map((point) => point.toArray()); },
    /** Moves a coordinate to a value as its slider does; returns all coordinates. */
    slide(name, value) { parts.slide(parts.sliders.sliders.find((s) => s.name === name), value); return [...parts.pose]; },
    /** The number of poses received from a host. */
    received() { return parts.received; },
    shown() { return { ...state, row: parts.row() }; },
    frames() { return parts.renderer.info.render.frame; },
  };
  if (!drive) return;
  const { run, rival } = drive;
  window.cutjoint.drive = {
    /** Some steps with scripted keys, [step, 'down' or 'up', code], as fast as possible. */
    steps(count, keys = []) {
      for (let i = 0; i < count && !run.fault; i++) {
        for (const [at, how, code] of keys) if (at === run.step) run.keys[how === 'down' ? 'add' : 'delete'](code);
        drive.takeSteps(1);
      }
      drive.showDriven(true);
      return run.step;
    },
    road: drive.changeRoad, continueDrive: drive.continueDrive, ghost: drive.raceGhost, store: drive.storeDrive, kept: () => drive.kept,
    rewind: drive.rewind, reset: drive.resetDrive, table: drive.driveTable, log: drive.driveLog, camera: drive.chooseCamera,
    heights() { return Array.from(run.road.field?.heights ?? []); },
    groundBelow() { return drive.heightAt(run.sim.poses[0], run.sim.poses[1]); },
    /** The position of a body's ghost, in the model's axes. */
    rival(body) { return rival.figure.nodes.get(body).position.toArray(); },
    shown() {
      const axes = Object.fromEntries(run.axes.map((axis) => [axis.name, axis.value])), { step, late, camera: at } = run;
      return {
        step, late, axes, camera: at, time: run.sim.time, fault: run.fault?.message ?? '', playing: state.playing, snapshots: run.snapshots.length,
        road: run.road?.name ?? '', ghost: rival.rows?.length ?? 0,
      };
    },
    outputs() { return Array.from(run.sim.outputs); },
    simulation() { return run.sim; },
  };
})();
